#!/usr/bin/env python3
"""Draws the charts of estimators as PNG and SVG: charts.py FOLDER ESTIMATORS.csv SUMS.csv, in any order.

Needs python3-matplotlib. `treelight estimators` runs this.
"""
import sys

from chart_style import pyplot, read, save

PLACES = ["plane", "sphere", "small_sphere", "edge", "corner_2", "corner_3", "peak", "beside"]
KERNELS = {"constant": ("o", "#444444"), "cone": ("^", "#1f77b4"), "epanechnikov": ("s", "#d62728")}
RADII = {"nearest": ("k nearest", "-"), "fixed": ("fixed radius", "--")}
METHODS = {"float": ("float32", "#d62728"), "lanes_32": ("float32, 32 lanes", "#ff7f0e"),
           "pairwise": ("float32, pairwise", "#2ca02c"), "compensated": ("float32, compensated", "#1f77b4"),
           "double": ("double", "#444444"), "gather": ("gather", "#9467bd")}
NUMBERS = {"place": ("photons", "k", "samples", "bias", "standard_error", "deviation", "rms"),
           "method": ("photons", "error", "nanoseconds")}  # by the first column of the file


def read_all(paths):
    """Rows by the first column of their file."""
    rows = {kind: [] for kind in NUMBERS}
    for path in paths:
        with open(path) as file:
            kind = file.readline().split(",")[0]
        if kind not in rows:
            sys.exit(f"{path}:1: neither estimators.csv nor sums.csv")
        rows[kind] += read(path, "the estimators", NUMBERS[kind])
    return rows["place"], rows["method"]


def nearest(values, wanted):
    return min(values, key=lambda value: abs(value - wanted))


def draw_bias(rows, folder):
    """By place, of one k and the most photons that all places have."""
    k = nearest({row["k"] for row in rows}, 50)
    rows = [row for row in rows if row["k"] == k]
    figure, axes = pyplot.subplots(figsize=(8, 3.6))
    places = [place for place in PLACES if any(row["place"] == place for row in rows)]
    for place_index, place in enumerate(places):
        own = [row for row in rows if row["place"] == place]
        photons = max((row["photons"] for row in own if row["photons"] <= 1e5), default=max(row["photons"] for row in own))
        for radius_index, radius in enumerate(RADII):
            for kernel_index, (kernel, (marker, color)) in enumerate(KERNELS.items()):
                for row in own:
                    if (row["photons"], row["radius"], row["kernel"]) != (photons, radius, kernel):
                        continue
                    axes.errorbar(place_index + 0.3 * radius_index - 0.15 + 0.08 * (kernel_index - 1), 100 * row["bias"],
                                  yerr=100 * row["deviation"], fmt=marker, color=color, markersize=4, linewidth=0.8,
                                  markerfacecolor=color if radius == "nearest" else "white",
                                  label=f"{kernel}, {RADII[radius][0]}" if place_index == 0 else None)
    axes.axhline(0, color="#999999", linewidth=0.8)
    axes.set_ylim(-110, 60)
    axes.set_xticks(range(len(places)), places)
    axes.set_ylabel(f"bias and deviation, %, k {k:.0f}")
    axes.legend(fontsize=7, ncol=2, loc="lower right")
    save(figure, folder, "bias")


def draw_deviation(rows, folder):
    """Of the plane, over k."""
    rows = [row for row in rows if row["place"] == "plane"]
    photons = nearest({row["photons"] for row in rows}, 1e5)
    figure, axes = pyplot.subplots(1, 2, figsize=(8, 3.4))
    for radius, (label, line) in RADII.items():
        for kernel, (marker, color) in KERNELS.items():
            own = sorted((row for row in rows if (row["photons"], row["radius"], row["kernel"]) == (photons, radius, kernel)),
                         key=lambda row: row["k"])
            k = [row["k"] for row in own]
            axes[0].plot(k, [100 * row["deviation"] for row in own], line, marker=marker, color=color, markersize=4,
                         label=f"{kernel}, {label}")
            axes[1].errorbar(k, [100 * row["bias"] for row in own], yerr=[200 * row["standard_error"] for row in own],
                             linestyle=line, marker=marker, color=color, markersize=4)
    axes[0].set(xscale="log", yscale="log", xlabel="k", ylabel="deviation, %")
    axes[1].set(xscale="log", xlabel="k", ylabel="bias, %, and twice its standard error")
    axes[0].legend(fontsize=7)
    save(figure, folder, "deviation")


def draw_caustic(rows, folder):
    """RMS error at the peak and beside it, over photons, of Epanechnikov's kernel."""
    figure, axes = pyplot.subplots(1, 2, figsize=(8, 3.4))
    for axis, place in zip(axes, ("peak", "beside")):
        own = [row for row in rows if row["place"] == place and row["kernel"] == "epanechnikov"]
        for index, k in enumerate(sorted({row["k"] for row in own})):
            for radius, (label, line) in RADII.items():
                points = sorted((row["photons"], 100 * row["rms"]) for row in own if (row["k"], row["radius"]) == (k, radius))
                axis.plot(*zip(*points), line, marker="o", markersize=3, color=f"C{index}", label=f"k {k:.0f}, {label}")
        axis.set(xscale="log", yscale="log", xlabel="photons", title="peak of a caustic" if place == "peak" else "beside it")
    axes[0].set_ylabel("RMS error, %")
    axes[1].legend(fontsize=6)
    save(figure, folder, "caustic")


def draw_sums(rows, folder):
    figure, axes = pyplot.subplots(figsize=(6, 3.6))
    for method, (label, color) in METHODS.items():
        for index, device in enumerate(sorted({row["device"] for row in rows if row["method"] == method})):
            points = sorted((row["photons"], max(row["error"], 1e-10)) for row in rows
                            if (row["method"], row["device"]) == (method, device))
            axes.plot(*zip(*points), (":", "-.", "--")[index % 3] if device else "-", marker="o^sv"[index % 4], markersize=3, color=color,
                      label=f"{label} on {device}" if device else label)
    axes.set(xscale="log", yscale="log", xlabel="photons added up", ylabel="relative error")
    axes.legend(fontsize=7)
    save(figure, folder, "sums")


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    places, methods = read_all(sys.argv[2:])
    if places:
        for draw in (draw_bias, draw_deviation, draw_caustic):
            draw(places, sys.argv[1])
    if methods:
        draw_sums(methods, sys.argv[1])


main()
