#!/usr/bin/env python3
"""Draws the charts of accuracy as PNG and SVG: charts.py FOLDER ACCURACY.csv...

A panel for each scene and k. Lines join the settings that no other beats in both error and time: the Pareto fronts.
Needs python3-matplotlib. `treelight accuracy` runs this.
"""
import sys

from chart_style import pyplot, read, save

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
}
WIRE = ("quantized", "halves", "quantized_halves")  # what these cost the device is what exact gathers do
WITHIN = ("radius", "weight_tolerance", "merged_within", "thinned_within", "error_within")
NUMBERS = ("value", "k", "density_error", "kernel_ns", "picture_rmse", "picture_s", "reference_noise")
LEAST = 1e-7  # what is exact is drawn here: errors of float's roundings


def front(points):
    """The points (time, error) that no other is at most equal to in both."""
    best, least = [], float("inf")
    for time, error in sorted(points):
        if error < least:
            best.append((time, error))
            least = error
    return best


def panel(axes, rows, time, error):
    for knob, (label, marker, color) in STYLES.items():
        own = [row for row in rows if row["knob"] == knob]
        if own:
            axes.plot([row[time] for row in own], [max(row[error], LEAST) for row in own], marker, color=color,
                      label=label, markersize=5)
            for row in own:
                if row["value"] > 0:
                    axes.annotate(f"{row['value']:g}", (row[time], max(row[error], LEAST)), fontsize=6,
                                  xytext=(3, 3), textcoords="offset points")
    for within, color in ((False, "#bbbbbb"), (True, "#e0c8f0")):  # other questions than each other's
        line = front([(row[time], max(row[error], LEAST)) for row in rows if (row["knob"] in WITHIN) == within])
        if line:
            axes.plot(*zip(*line), "-", color=color, zorder=0,
                      label="Pareto front, within a radius" if within else "Pareto front, k nearest")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(True, which="both", color="#eeeeee")


def draw(rows, folder, name, time, error, labels):
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
                panel(grid[i][j], own, time, error)
            grid[i][j].set_xlabel(labels[0])
            grid[i][j].set_ylabel(labels[1])
    handles = dict(zip(*reversed(grid[0][0].get_legend_handles_labels())))
    columns = 2 * len(ks)
    lines = -(-len(handles) // columns)
    figure.legend(handles.values(), handles.keys(), ncol=columns, loc="lower center", fontsize=7)
    save(figure, folder, name, (0, (0.1 + 0.17 * lines) / (3.2 * len(scenes)), 1, 1))


def main():
    folder, paths = sys.argv[1], sys.argv[2:]
    rows = [row for path in paths for row in read(path, "an accuracy run", NUMBERS, ("scene", "knob"))]
    draw([row for row in rows if row["knob"] not in WIRE], folder, "density", "kernel_ns", "density_error",
         ("time of a gather on the device, ns", "density, relative RMS error"))
    draw([row for row in rows if row["picture_s"] > 0], folder, "pictures", "picture_s", "picture_rmse",
         ("time of the picture, s", "RMSE against path tracing"))


main()
