#!/usr/bin/env python3
"""Sets on which methods fail, from the CSV of tests/stability and tests/peers (stability_peers).

    stability.py trees stability.csv >table.md
    stability.py builders stability.csv >table.md
    stability.py peers peers.csv >table.md
    stability.py plot peers.csv peers.png

Figures are relative to the uniform set of the same run. `plot` needs python3-matplotlib.
"""
import csv
import sys

LIBRARIES = ["nanoflann", "FLANN", "CGAL", "treelight lbvh", "treelight hybrid"]
FEW = "31_photons"  # fewer than k
KARRAS = "karras"  # the study's baseline, told apart


def read(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def ratio(row, uniform, column):
    return float(row[column]) / float(uniform[column])


def names(rows, column):
    return list(dict.fromkeys(row[column] for row in rows))


def short(value):
    return f"{value:.0f}" if value >= 9.95 else f"{value:.1f}" if value >= 0.095 else f"{value:.2f}"


def trees(path):
    """For each set: how many builders were right, and the worst of them but Karras's in each figure."""
    rows = read(path)
    uniform = {row["tree"]: row for row in rows if row["set"] == "uniform"}
    print("| set | right | depth | nodes | build | k 50 | count | work | peak memory |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for name in names(rows, "set"):
        own = [row for row in rows if row["set"] == name]
        right = [row for row in own if row["outcome"] == "right"]
        judged = [row for row in right if not row["tree"].startswith(KARRAS)]
        cells = [f"{len(right)} of {len(own)}", str(max(int(row["depth"]) for row in right))]
        for column in ("inner_nodes", "build_ms", "k50_us", "count_us", "work", "peak_bytes"):
            cells.append(short(max(ratio(row, uniform[row["tree"]], column) for row in judged)))
        print(f"| {name} | " + " | ".join(cells) + " |")


def builders(path):
    """For each builder: the set with the worst work and the worst build."""
    rows = read(path)
    uniform = {row["tree"]: row for row in rows if row["set"] == "uniform"}
    print("| tree | uniform: build ms, k 50 us | deepest | slowest build | most work |")
    print("|---|--:|---|---|---|")
    for tree in names(rows, "tree"):
        own = [row for row in rows if row["tree"] == tree and row["outcome"] == "right"]
        base = uniform[tree]
        deepest = max(own, key=lambda row: int(row["depth"]))
        slowest = max(own, key=lambda row: ratio(row, base, "build_ms"))
        hardest = max(own, key=lambda row: ratio(row, base, "work"))
        print(f"| {tree} | {float(base['build_ms']):.0f}, {float(base['k50_us']):.2g} | {deepest['depth']}, {deepest['set']} | "
              f"{short(ratio(slowest, base, 'build_ms'))}, {slowest['set']} | {short(ratio(hardest, base, 'work'))}, {hardest['set']} |")


def outcome(row):
    """One word, or the times relative to uniform: of a build, of the 50 nearest, of a count."""
    text = row["outcome"]
    if text == "right":
        return "right" if row["set"] == FEW else None  # too few to compare their times
    if text.startswith("exception: positions["):
        return "refused"
    return "**wrong**" if text.startswith("wrong") else f"**{text}**"


def peers(path):
    rows = read(path)
    uniform = {row["library"]: row for row in rows if row["set"] == "uniform"}
    print("| set | " + " | ".join(LIBRARIES) + " |")
    print("|---|" + "--:|" * len(LIBRARIES))
    for name in names(rows, "set"):
        cells = []
        for library in LIBRARIES:
            row = next(row for row in rows if (row["set"], row["library"]) == (name, library))
            cells.append(outcome(row) or " / ".join(short(ratio(row, uniform[library], column))
                                                    for column in ("build_ms", "k50_us", "count_us")))
        print(f"| {name} | " + " | ".join(cells) + " |")


def plot(path, output):
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["font.size"] = 8
    from matplotlib import pyplot

    rows = [row for row in read(path) if row["set"] not in (FEW, "beyond_limit")]
    uniform = {row["library"]: row for row in rows if row["set"] == "uniform"}
    sets = [name for name in names(rows, "set") if name != "uniform"]
    figure, axes = pyplot.subplots(1, 3, figsize=(10, 5), sharey=True)
    for axis, column, title in zip(axes, ("build_ms", "k50_us", "count_us"), ("build", "50 nearest", "count within a radius")):
        for index, library in enumerate(LIBRARIES):
            for place, name in enumerate(sets):
                row = next(row for row in rows if (row["set"], row["library"]) == (name, library))
                y = place + 0.14 * (index - 2)
                if row["build_ms"]:
                    wrong = row["outcome"] != "right"
                    axis.plot(ratio(row, uniform[library], column), y, "x" if wrong else "o", color=f"C{index}", markersize=4)
                else:  # nothing was measured
                    axis.plot(2e3, y, ">", color=f"C{index}", markersize=5)
        axis.axvline(1, color="#999999", linewidth=0.8)
        axis.set(xscale="log", title=f"{title}, time relative to uniform", xlim=(0.01, 4e3))
        axis.grid(axis="x", linewidth=0.3)
    axes[0].set_yticks(range(len(sets)), sets)
    axes[0].invert_yaxis()
    handles = [pyplot.Line2D([], [], marker="o", linestyle="", color=f"C{index}", label=library) for index, library in enumerate(LIBRARIES)]
    handles += [pyplot.Line2D([], [], marker="x", linestyle="", color="black", label="wrong answers"),
                pyplot.Line2D([], [], marker=">", linestyle="", color="black", label="crash or no end")]
    figure.legend(handles=handles, loc="lower center", ncol=7)
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    figure.savefig(output, dpi=130)


def main():
    commands = {"trees": trees, "builders": builders, "peers": peers, "plot": plot}
    if len(sys.argv) < 3 or sys.argv[1] not in commands:
        sys.exit(__doc__)
    commands[sys.argv[1]](*sys.argv[2:])


main()
