#!/usr/bin/env python3
"""Searches on one thread of a CPU beside those of other libraries, from the CSV of tests/peers.

    cpu_peers.py table cpu_peers.csv >table.md
    cpu_peers.py plot cpu_peers.csv cpu_peers.png "MACHINE"

Each library at its fastest setting in each cell, ours too. `plot` needs python3-matplotlib.
"""
import csv
import sys

SEARCHES = ["k 8", "k 50", "k 100", "k 50 in r1", "count in r1"]


def best(path):
    """(set, photons, order, search) -> {library: (median, setting, low, high)}, the fastest setting of each."""
    cells = {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            cell = cells.setdefault((row["set"], int(row["photons"]), row["order"], row["search"]), {})
            library = row["library"].split()[0]
            if library == "treelight" and row["search"] == "build":
                library = " ".join(row["library"].split()[:2])
            figure = (float(row["median"]), row["library"], float(row["min"]), float(row["max"]))
            cell[library] = min(cell.get(library, figure), figure)
    return cells


def table(path):
    cells = best(path)
    print("| set, photons, order | " + " | ".join(SEARCHES) + " |")
    print("|---|" + "--:|" * len(SEARCHES))
    for key in sorted({cell[:3] for cell in cells if cell[2]}, key=lambda c: (c[1], c[0], c[2])):
        line = [f"{key[0]} {key[1]:.0e} {key[2]}".replace("e+0", "e")]
        for search in SEARCHES:
            cell = cells[(*key, search)]
            ours = cell["treelight"]
            name, peer = min(((n, f) for n, f in cell.items() if n != "treelight"), key=lambda x: x[1])
            line.append(f"{ours[0]:.3g} / {peer[0]:.3g} {name}: **{peer[0] / ours[0]:.1f}**")
        print("| " + " | ".join(line) + " |")
    print()
    libraries = sorted({n for cell, figures in cells.items() if cell[3] == "build" for n in figures})
    print("| build, ms | " + " | ".join(libraries) + " |")
    print("|---|" + "--:|" * len(libraries))
    for cell in sorted((c for c in cells if c[3] == "build"), key=lambda c: (c[1], c[0])):
        print(f"| {cell[0]} {cell[1]:.0e} | ".replace("e+0", "e") + " | ".join(f"{cells[cell][n][0]:.3g}" for n in libraries) + " |")


def plot(path, picture, machine):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    cells = best(path)
    rows = sorted({cell[:3] for cell in cells if cell[2]}, key=lambda c: (c[1], c[0], c[2]))
    libraries = ["treelight", "nanoflann", "FLANN", "CGAL"]
    figure, axes = pyplot.subplots(len(SEARCHES), 1, figsize=(11, 13), sharex=True)
    for axis, search in zip(axes, SEARCHES):
        for i, library in enumerate(libraries):
            figures = [cells[(*row, search)].get(library) for row in rows]
            places = [p + 0.2 * (i - 1.5) for p, f in enumerate(figures) if f]
            figures = [f for f in figures if f]
            medians = [f[0] for f in figures]
            errors = [[f[0] - f[2] for f in figures], [f[3] - f[0] for f in figures]]
            axis.bar(places, medians, 0.2, yerr=errors, label=library, error_kw={"linewidth": 0.7})
        axis.set_title(search, fontsize=10, loc="left")
        axis.set_ylabel("us a query")
        axis.set_yscale("log")
        axis.grid(axis="y", which="both", linewidth=0.3)
    axes[0].legend(ncols=4, fontsize=9, loc="upper right")
    axes[-1].set_xticks(range(len(rows)), [f"{r[0]} {r[1]:.0e}\n{r[2]}".replace("e+0", "e") for r in rows], fontsize=8)
    figure.suptitle(f"Searches on one thread, CPU time, each at its fastest setting; bars: median, lines: min and max\n{machine}", fontsize=11)
    figure.tight_layout()
    figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    {"table": table, "plot": plot}[sys.argv[1]](*sys.argv[2:])
