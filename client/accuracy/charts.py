#!/usr/bin/env python3
"""Draws the charts of accuracy as PNG and SVG: charts.py FOLDER ACCURACY.csv...

A panel for each scene and k. Lines join the settings that no other beats in both error and cost: the Pareto fronts; those of
the k nearest, and those within a radius, which answer another question. Rings and the values of knobs mark their points.
density: over the time of a gather on its device; wire: over the bytes that it takes; pictures: over the time of the picture.
Needs python3-matplotlib. `treelight accuracy` runs this.
"""
import sys

from chart_style import pyplot, read, save
from matplotlib import ticker

STYLES = {
    "exact": ("k nearest, exact", "o", "#444444"),
    "epsilon": ("(1 + epsilon) nearest", "s", "#1f77b4"),
    "max_leaves": ("budget of leaves", "^", "#d62728"),
    "radius": ("within a radius, exact", "o", "#9467bd"),
    "weight_tolerance": ("whole subtrees summed", "v", "#ff7f0e"),
    "merged_photons": ("merged photons, k nearest", "P", "#17becf"),
    "max_relative_error": ("an error asked for, k nearest", "*", "#0b5f6b"),
    "merged_within": ("merged photons, within a radius", "X", "#e377c2"),
    "thinned_photons": ("random subset, k nearest", "D", "#2ca02c"),
    "thinned_within": ("random subset, within a radius", "d", "#8fce6a"),
    "error_within": ("an error asked for, within a radius", "*", "#8c1a6a"),
    "quantized": ("16-bit queries, k nearest", "<", "#8c564b"),
    "halves": ("half answers, k nearest", ">", "#bcbd22"),
    "quantized_halves": ("16-bit queries, half answers, k nearest", "h", "#7f7f7f"),
}
WIRE = ("exact", "quantized", "halves", "quantized_halves")  # the same gather in other bytes
WITHIN = ("radius", "weight_tolerance", "merged_within", "thinned_within", "error_within")
NUMBERS = ("value", "k", "density_error", "kernel_ns", "picture_rmse", "picture_s", "reference_noise")
LEAST = 1e-7  # what is exact is drawn here: errors of float's roundings


def front(points):
    """The points (cost, error) that no other is at most equal to in both."""
    best, least = [], float("inf")
    for cost, error in sorted(points):
        if error < least:
            best.append((cost, error))
            least = error
    return best


def panel(axes, rows, cost, error):
    points = [(row[cost], max(row[error], LEAST)) for row in rows]
    for knob, (label, marker, color) in STYLES.items():
        own = [point for point, row in zip(points, rows) if row["knob"] == knob]
        if own:
            axes.plot(*zip(*own), marker, color=color, label=label, markersize=5)
    for within, color in ((False, "#888888"), (True, "#b98fd6")):
        line = front([point for point, row in zip(points, rows) if (row["knob"] in WITHIN) == within])
        if line:
            axes.plot(*zip(*line), "-o", color=color, markerfacecolor="none", markersize=9, zorder=1,
                      label="Pareto front, within a radius" if within else "Pareto front, k nearest")
        for point, row in zip(points, rows):
            if (row["knob"] in WITHIN) == within and row["value"] > 0 and point in line:
                axes.annotate(f"{row['value']:g}", point, fontsize=6, xytext=(3, 3), textcoords="offset points")
    axes.set_xscale("log")
    axes.set_yscale("log")
    low, high = axes.get_xlim()
    axes.xaxis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5)) if high > 5 * low else ticker.MaxNLocator(5))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_locator(ticker.NullLocator())
    axes.set_axisbelow(True)
    axes.grid(True, color="#eeeeee")


def draw(rows, folder, name, cost, error, labels):
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    ks = sorted({row["k"] for row in rows})
    if not rows:
        return
    figure, grid = pyplot.subplots(len(scenes), len(ks), squeeze=False, figsize=(4.6 * len(ks), 3.2 * len(scenes)))
    for i, scene in enumerate(scenes):
        for j, k in enumerate(ks):
            own = [row for row in rows if row["scene"] == scene and row["k"] == k]
            grid[i][j].set_title(f"{scene}, k {k:g}")
            if own:
                panel(grid[i][j], own, cost, error)
            grid[i][j].set_xlabel(labels[0])
            grid[i][j].set_ylabel(labels[1])
    handles = {}
    for axes in figure.axes:
        handles |= dict(zip(*reversed(axes.get_legend_handles_labels())))
    columns = 2 * len(ks)
    lines = -(-len(handles) // columns)
    figure.legend(handles.values(), handles.keys(), ncol=columns, loc="lower center", fontsize=7)
    save(figure, folder, name, (0, (0.1 + 0.17 * lines) / (3.2 * len(scenes)), 1, 1))


def wire_bytes(row):
    """Bytes of a gather, there and back; 0 in a file of before they were counted."""
    return sum(float(row.get(column) or 0) for column in ("request_bytes", "answer_bytes"))


def main():
    folder, paths = sys.argv[1], sys.argv[2:]
    rows = [row | {"bytes": wire_bytes(row), "scene": row["scene"] + (" with normals" if row.get("normals") == "1" else "")}
            for path in paths for row in read(path, "an accuracy run", NUMBERS, ("scene", "knob"))]
    draw(rows, folder, "density", "kernel_ns", "density_error",
         ("time of a gather on the device, ns", "density, relative RMS error"))
    draw([row for row in rows if row["knob"] in WIRE and row["bytes"] > 0], folder, "wire", "bytes", "density_error",
         ("bytes of a gather on the wire", "density, relative RMS error"))
    draw([row for row in rows if row["picture_s"] > 0], folder, "pictures", "picture_s", "picture_rmse",
         ("time of the picture, s", "RMSE against path tracing"))


main()
