#!/usr/bin/env python3
"""`treelight render --photons auto` beside pictures of fixed numbers: error against the reference, and time.

    auto.py measure TREELIGHT SERVER PID SCENE REFERENCE.exr NOISE   # appends rows of a scene to auto.csv
    auto.py plot auto.png                                            # draws all scenes, prints what was compared

PID is the process of the server: seconds are those of all cores, of both programs, so that others on the machine count
less. REFERENCE.exr has 128 x 128 pixels; NOISE is its own relative mean squared error, which is subtracted. `plot` needs
python3-matplotlib.
"""
import csv
import math
import os
import re
import resource
import subprocess
import sys
import tempfile

FOLDER = os.path.dirname(os.path.abspath(__file__))
CSV = FOLDER + "/auto.csv"
COLUMNS = ["scene", "way", "target", "photons", "k", "spp", "passes", "cpu_s", "predicted", "estimated", "measured"]
TARGETS = (0.1, 0.07, 0.05)
FIXED = [(10_000, 50, 4), (30_000, 50, 4), (30_000, 50, 9), (30_000, 50, 16), (100_000, 50, 9), (100_000, 100, 4), (100_000, 100, 9),
         (100_000, 100, 16), (100_000, 100, 36), (400_000, 100, 36)]
ROUNDS = 2  # in turns, each with a seed of its own; the mean time counts


def cpu_seconds(pid):
    with open(f"/proc/{pid}/stat") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    server = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    client = resource.getrusage(resource.RUSAGE_CHILDREN)
    return server + client.ru_utime + client.ru_stime


def render(treelight, server, pid, scene, reference, options):
    with tempfile.TemporaryDirectory() as folder:
        before = cpu_seconds(pid)
        done = subprocess.run([treelight, "--server", server, "render", "--scene", scene, "--width", "128", "--height", "128",
                               "--compare", reference, "--output", folder + "/p.png", *options],
                              check=True, stdout=subprocess.PIPE, text=True)
        return cpu_seconds(pid) - before, done.stdout


def number(pattern, text):
    found = re.search(pattern, text)
    return found.group(1) if found else ""


def measure(treelight, server, pid, scene, reference, noise):
    name = os.path.splitext(os.path.basename(scene))[0]
    new = not os.path.exists(CSV)
    with open(CSV, "a", newline="") as file:
        out = csv.DictWriter(file, COLUMNS)
        if new:
            out.writeheader()

        def row(way, options, **known):
            cpu_s, text = render(treelight, server, pid, scene, reference, options)
            mse = float(number(r"relative MSE ([\d.e-]+)", text)) - noise
            out.writerow({"scene": name, "way": way, "cpu_s": f"{cpu_s:.3f}", "measured": f"{math.sqrt(max(mse, 0)):.5f}",
                          **known, **({
                              "photons": number(r"photons: (\d+);", text), "k": number(r"k (\d+) and", text),
                              "spp": number(r"k \d+ and (\d+) sample", text), "passes": number(r"(\d+) pass(?:es)? in", text),
                              "predicted": number(r"error ([\d.]+) of", text),
                              "estimated": number(r"estimated error: ([\d.]+)", text)} if way == "auto" else {})})
            file.flush()

        for seed in range(1, 1 + ROUNDS):  # others on the machine slow all ways alike
            for target in TARGETS:
                row("auto", ["--photons", "auto", "--target-error", str(target), "--seed", str(seed)], target=target)
            for photons, k, spp in FIXED:
                row("fixed", ["--seed", str(seed), "--photons", str(photons), "--caustic-photons", str(photons // 5), "--k", str(k),
                              "--caustic-k", str(k * 3 // 5), "--spp", str(spp)], photons=photons, k=k, spp=spp)


def means(rows):
    """One row for each way, with the mean of the times, the root mean square of the errors, and by how much times differ."""
    groups = {}
    for row in rows:
        way = (row["scene"], row["way"]) + ((row["target"],) if row["way"] == "auto" else (row["photons"], row["k"], row["spp"]))
        groups.setdefault(way, []).append(row)
    merged = []
    for group in groups.values():
        row = dict(group[0])
        times = [float(r["cpu_s"]) for r in group]
        row["cpu_s"], row["spread"] = f"{sum(times) / len(times):.3f}", (max(times) - min(times)) * len(times) / sum(times)
        row["measured"] = f"{math.sqrt(sum(float(r['measured']) ** 2 for r in group) / len(group)):.5f}"
        merged.append(row)
    return merged


def plot(chart):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    with open(CSV, newline="") as file:
        rows = means(csv.DictReader(file))
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    figure, all_axes = pyplot.subplots(1, len(scenes), figsize=(4 * len(scenes), 3.6), squeeze=False)
    for scene, axes in zip(scenes, all_axes[0]):
        auto, fixed = ([r for r in rows if r["scene"] == scene and r["way"] == way] for way in ("auto", "fixed"))
        for way, style, color in ((fixed, "x", "#999999"), (auto, "o-", "#d62728")):
            axes.loglog([float(r["measured"]) for r in way], [float(r["cpu_s"]) for r in way], style, color=color,
                        label="auto" if way is auto else "fixed numbers")
        for r in auto:
            print(f"{scene}, target {r['target']}: predicted {r['predicted']}, estimated {r['estimated']}, measured "
                  f"{r['measured']}; {r['passes']} passes, {r['photons']} photons, k {r['k']}, {r['spp']} spp, {r['cpu_s']} s, "
                  f"differing by {100 * r['spread']:.0f} %")
            for what, error in (("as asked", r["target"]), ("as good", r["measured"])):
                reached = [f for f in fixed if float(f["measured"]) <= float(error) * 1.001]
                if reached:
                    best = min(reached, key=lambda f: float(f["cpu_s"]))
                    print(f"  best fixed {what}: {best['photons']}, k {best['k']}, {best['spp']} spp, error {best['measured']}, "
                          f"{best['cpu_s']} s, differing by {100 * best['spread']:.0f} %; "
                          f"ratio {float(r['cpu_s']) / float(best['cpu_s']):.2f}")
        axes.set_title(scene)
        axes.set_xlabel("root of the relative MSE")
        axes.grid(True, which="both", alpha=0.3)
    all_axes[0][0].set_ylabel("CPU seconds, client and server")
    all_axes[0][0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(chart, dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    if len(sys.argv) == 8 and sys.argv[1] == "measure":
        measure(*sys.argv[2:7], float(sys.argv[7]))
    elif len(sys.argv) == 3 and sys.argv[1] == "plot":
        plot(sys.argv[2])
    else:
        sys.exit(__doc__)
