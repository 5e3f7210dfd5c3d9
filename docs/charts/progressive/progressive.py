#!/usr/bin/env python3
"""How the error of `cornell` falls with the passes of `treelight render --progressive`.

    progressive.py measure TREELIGHT SERVER REFERENCE.exr   # writes cornell_k32.csv and cornell_k100.csv
    progressive.py plot NOISE progressive.png               # draws both, and prints the fitted powers

REFERENCE.exr has 128 x 128 pixels. NOISE is its own relative mean squared error, which is subtracted from what was
measured: of two references of n and m samples it is that between them times m / (n + m), for the one of n. `plot` needs
python3-matplotlib.
"""
import csv
import math
import os
import subprocess
import sys
import tempfile

FOLDER = os.path.dirname(os.path.abspath(__file__))
RUNS = {
    "cornell_k32": (400, ["--spp", "4", "--photons", "50000", "--caustic-photons", "10000", "--k", "32", "--caustic-k", "24"]),
    "cornell_k100": (512, ["--photons", "20000", "--caustic-photons", "4000"]),
}
LABELS = {
    "cornell_k32": "5e4 + 1e4 photons, k 32 and 24, 4 samples a pixel",
    "cornell_k100": "2e4 + 4e3 photons, k 100 and 60, 1 sample a pixel",
}
FIRST = 8  # pass from which on powers are fitted


def measure(treelight, server, reference):
    for name, (passes, options) in RUNS.items():
        with tempfile.TemporaryDirectory() as folder:
            command = [treelight, "--server", server, "render", "--progressive", "--scene", "cornell", "--width", "128",
                       "--height", "128", "--passes", str(passes), "--compare", reference, "--error-curve", folder,
                       "--output", folder + "/picture.png", *options]
            subprocess.run(command, check=True)
            os.replace(folder + "/progressive.csv", f"{FOLDER}/{name}.csv")


def power(points):
    """The power that fits points (passes, error) from FIRST on, each doubling of the passes weighing the same."""
    logs = [(math.log(x), math.log(y), 1 / x) for x, y in points if x >= FIRST and y > 0]
    weight = sum(w for _, _, w in logs)
    mean_x = sum(w * x for x, _, w in logs) / weight
    mean_y = sum(w * y for _, y, w in logs) / weight
    return sum(w * (x - mean_x) * (y - mean_y) for x, y, w in logs) / sum(w * (x - mean_x) ** 2 for x, _, w in logs)


def plot(noise, chart):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7.5, 5))
    for name, color in zip(RUNS, ("#d62728", "#1f77b4")):
        with open(f"{FOLDER}/{name}.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        measured = [(int(r["passes"]), float(r["measured_mse"]) - noise) for r in rows]
        estimated = [(int(r["passes"]), float(r["estimated_mse"])) for r in rows if r["estimated_mse"]]
        for points, style, what in ((measured, "-", "measured"), (estimated, "--", "estimated")):
            fit = f"passes^{power(points):.2f}"
            print(f"{name}, {what}: {fit} from pass {FIRST} to {points[-1][0]}, {points[-1][1]:.3g} at the end")
            axes.loglog(*zip(*points), style, color=color, label=f"{what}, {fit}: {LABELS[name]}")
        if name == "cornell_k32":
            x, y = measured[FIRST - 1]
            axes.loglog([1, 512], [y * (p / x) ** (-2 / 3) for p in (1, 512)], color="#bbbbbb", zorder=0,
                        label="passes^(-2/3)")
    axes.set_xlabel("passes")
    axes.set_ylabel("relative mean squared error, without the reference's noise")
    axes.set_title(f"cornell, 128 x 128; powers are fitted from pass {FIRST} on")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(chart, dpi=120, metadata={"Software": None})


if __name__ == "__main__":
    if len(sys.argv) == 5 and sys.argv[1] == "measure":
        measure(*sys.argv[2:])
    elif len(sys.argv) == 4 and sys.argv[1] == "plot":
        plot(float(sys.argv[2]), sys.argv[3])
    else:
        sys.exit(__doc__)
