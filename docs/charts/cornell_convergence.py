#!/usr/bin/env python3
"""How pictures of `cornell` approach the path-traced reference as photons grow.

    cornell_convergence.py measure TREELIGHT SERVER REFERENCE.exr >cornell_convergence.csv
    cornell_convergence.py plot cornell_convergence.csv cornell_convergence.png

`measure` renders by way of a running treelightd at SERVER, 64 samples a pixel, and prints a line for
each picture. N photons go to the indirect map and N / 5 to the caustic map, and an estimate takes

    radius = r0 (N / 1e6)^(-1/4), k = k0 (N / 1e6)^(1/2),

so that both its bias, of the order radius^2, and its variance, of the order 1 / k, vanish as
N^(-1/2); r0 and k0 are what `treelight render` takes at 1e6 photons. `fixed` keeps r0 and k0: what
is left then is bias. `plot` needs python3-matplotlib.
"""
import csv
import re
import subprocess
import sys

COUNTS = [10_000, 31_623, 100_000, 316_228, 1_000_000, 3_162_278, 10_000_000]
RENDERS = {
    "shrinking radius": [],
    "shrinking radius, final gathering (4 rays)": ["--final-gather", "4"],
    "fixed radius": [],
}
FIELDS = ["estimate", "photons", "rmse", "clipped_rmse", "relative_mse", "mean_percent", "picture_s"]


def render(treelight, server, reference, name, photons):
    scale = 1.0 if name.startswith("fixed") else photons / 1e6
    command = [
        treelight, "--server", server, "render", "--scene", "cornell", "--spp", "64",
        "--photons", str(photons), "--caustic-photons", str(photons // 5),
        "--k", str(round(100 * scale**0.5)), "--radius", f"{0.1 * scale**-0.25:.5f}",
        "--caustic-k", str(round(60 * scale**0.5)), "--caustic-radius", f"{0.05 * scale**-0.25:.5f}",
        "--compare", reference, "--output", "/tmp/cornell_convergence.png", *RENDERS[name],
    ]
    out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    error = re.search(r"RMSE (\S+) \((\S+) .*relative MSE ([^,]+), mean (\S+) %", out).groups()
    return [name, photons, *error, re.search(r"picture (\S+) s", out).group(1)]


def measure(treelight, server, reference):
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(FIELDS)
    for name in RENDERS:
        for photons in COUNTS:
            writer.writerow(render(treelight, server, reference, name, photons))
            sys.stdout.flush()


def plot(table, chart):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    with open(table) as file:
        rows = list(csv.DictReader(file))
    figure, axes = pyplot.subplots(figsize=(7.5, 5))
    for name, marker in zip(RENDERS, "osd"):
        points = [(int(r["photons"]), float(r["clipped_rmse"])) for r in rows if r["estimate"] == name]
        if points:
            axes.loglog(*zip(*points), marker=marker, label=name)
    axes.set_xlabel("photons in the indirect map")
    axes.set_ylabel("RMSE against the reference, radiances clipped at 1")
    axes.set_title("cornell, 512 x 512, 64 samples a pixel")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend()
    figure.tight_layout()
    figure.savefig(chart, dpi=120, metadata={"Software": None})


if __name__ == "__main__":
    if len(sys.argv) == 5 and sys.argv[1] == "measure":
        measure(*sys.argv[2:])
    elif len(sys.argv) == 4 and sys.argv[1] == "plot":
        plot(*sys.argv[2:])
    else:
        sys.exit(__doc__)
