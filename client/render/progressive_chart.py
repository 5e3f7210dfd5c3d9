#!/usr/bin/env python3
"""Draws the error curve of a progressive render as PNG and SVG: charts.py FOLDER PROGRESSIVE.csv...

Relative mean squared errors over passes; of several files one curve each. The power of the passes that fits a curve from
pass FIRST on is in the legend. Needs python3-matplotlib. `treelight render --progressive --error-curve` runs this.
"""
import csv
import math
import os
import sys

try:
    import matplotlib
except ModuleNotFoundError:
    sys.exit("the chart needs matplotlib: apt install python3-matplotlib")

matplotlib.use("Agg")
matplotlib.rcParams["svg.hashsalt"] = "treelight"  # the same file for the same rows
from matplotlib import pyplot  # noqa: E402

FIRST = 10  # pass from which on a power is fitted
CURVES = {
    "measured_mse": ("against the reference", "-", "#d62728"),
    "estimated_mse": ("estimated", "-", "#1f77b4"),
    "estimated_variance": ("estimated: noise", "--", "#7fb2d8"),
    "estimated_squared_bias": ("estimated: blur", ":", "#2ca02c"),
}


def read(path):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    for line, row in enumerate(rows, start=2):
        try:
            row["passes"] = int(row["passes"])
            for column in CURVES:
                row[column] = float(row[column]) if row[column] else 0.0
        except (KeyError, TypeError, ValueError) as error:
            sys.exit(f"{path}:{line}: not a row of an error curve: {error}")
    return rows


def power(points):
    """The power that fits points (passes, error) from FIRST on, each doubling of the passes weighing the same."""
    logs = [(math.log(x), math.log(y), 1 / x) for x, y in points if x >= FIRST]
    if len(logs) < 3:
        return None
    weight = sum(w for _, _, w in logs)
    mean_x = sum(w * x for x, _, w in logs) / weight
    mean_y = sum(w * y for _, y, w in logs) / weight
    return sum(w * (x - mean_x) * (y - mean_y) for x, y, w in logs) / sum(w * (x - mean_x) ** 2 for x, _, w in logs)


def main():
    folder, paths = sys.argv[1], sys.argv[2:]
    figure, axes = pyplot.subplots(figsize=(7.5, 5))
    last = 1
    for path in paths:
        rows = read(path)
        name = os.path.splitext(os.path.basename(path))[0] + ": " if len(paths) > 1 else ""
        for column, (label, style, color) in CURVES.items():
            points = [(row["passes"], row[column]) for row in rows if row[column] > 0]
            if not points:
                continue
            fit = power(points)
            if fit is not None:
                label += f", passes^{fit:.2f} from {FIRST} to {points[-1][0]}"
            axes.loglog(*zip(*points), style, label=name + label, color=color if len(paths) == 1 else None)
            last = max(last, points[-1][0])
            if column == "measured_mse" or (column == "estimated_mse" and not axes.get_legend_handles_labels()[1][1:]):
                anchor = points[min(FIRST, len(points)) - 1]
                axes.loglog([1, last], [anchor[1] * (x / anchor[0]) ** (-2 / 3) for x in (1, last)], color="#bbbbbb",
                            zorder=0, label="passes^(-2/3)")
    axes.set_xlabel("passes")
    axes.set_ylabel("relative mean squared error")
    axes.grid(True, which="both", color="#eeeeee")
    axes.legend(fontsize=8)
    figure.tight_layout()
    for ending in ("png", "svg"):
        figure.savefig(f"{folder}/progressive.{ending}", dpi=120, metadata={"Date": None} if ending == "svg" else None)


main()
