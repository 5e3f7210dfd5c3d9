#!/usr/bin/env python3
"""Draws the charts of a study as PNG and SVG: charts.py FOLDER STUDY.csv...

FOLDER has summary.csv and gets the charts; STUDY.csv are the rows that it sums up. Needs
python3-matplotlib. `treelight study` runs this.
"""
import collections
import math
import sys

from chart_style import pyplot, read, save, unique

# Table 1 of Bulavintsev and Zhdanov 2020: SAH surface and search speed, percent of LBVH.
PAPER = {
    "TRBVH, triangles and rays (Karras and Aila 2013)": {
        "dragon": (86, 113), "sibenik": (78, 129), "conference": (59, 153)},
    "k-d treelets (Bulavintsev and Zhdanov 2020)": {
        "dragon": (88, 107), "sibenik": (89, 102), "conference": (90, 98)},
}
STANDS_IN = {"hall": "sibenik", "blob": "dragon", "room": "conference"}
OURS = {"trbvh sah 7x1": "trbvh, points", "treelet sah 7x1": "treelet sah, 1 round",
        "treelet isa 7x3": "treelet isa, 3 rounds"}
CURVES = {
    "lbvh": ("lbvh", "#444444", "-"),
    "treelet isa+leaf 7x3": ("treelet, isa and leaf term", "#1f77b4", "-"),
    "hybrid isa+leaf 256": ("hybrid, ceil(n/B)", "#d62728", "-"),
    "hybrid isa 256": ("hybrid, linear cost", "#d62728", ":"),
    "isa+leaf": ("isa top-down, ceil(n/B)", "#2ca02c", "-"),
    "isa": ("isa top-down, linear cost", "#2ca02c", ":"),
}
# Where leaves of one photon leave nothing of the leaf term.
CURVES_OF_ONE = {"treelet isa 7x3": "treelet isa+leaf 7x3", "hybrid isa 256": "hybrid isa+leaf 256",
                 "isa": "isa+leaf"}


def label(row):
    """As Label() of variant.cc."""
    text = row["builder"]
    if row["heuristic"] and row["heuristic"] != row["builder"]:
        text += " " + row["heuristic"]
    if row["leaf_term"] == "leaf_size":
        text += "+leaf"
    if int(row["rounds"]) > 0:
        text += f" {row['treelet_size']}x{row['rounds']}"
    if int(row["subtree_size"]) > 0:
        text += f" {row['subtree_size']}"
    return text


def half_width(row, field):
    width = float(row[field + "_ci95"])
    return 0 if width == float("inf") else width


def table1(summary, folder):
    rows = {(r["scene"], r["variant"]): r for r in summary if r["set"] == "image"}
    scenes = unique(scene for scene, _ in rows)
    if not scenes:
        return
    measured = [variant for variant in OURS if any((scene, variant) in rows for scene in scenes)]
    bars = [(name, None) for name in PAPER] + [(None, variant) for variant in measured]
    colors = dict(zip([*PAPER, *OURS], ["#c9c9c9", "#8c8c8c", "#9ecae1", "#1f77b4", "#08306b"]))
    figure, panels = pyplot.subplots(1, 2, figsize=(11, 4.4))
    for panel, field, column, title in (
            (panels[0], "sah_percent", 0, "SAH cost"), (panels[1], "exact_speed", 1, "Search speed")):
        width = 0.8 / len(bars)
        for i, (paper, variant) in enumerate(bars):
            places = [s + (i - (len(bars) - 1) / 2) * width for s in range(len(scenes))]
            if paper:
                values = [PAPER[paper][STANDS_IN.get(scene, scene)][column] for scene in scenes]
                errors, name = None, "paper: " + paper
            else:
                found = [rows.get((scene, variant)) for scene in scenes]
                values = [float(r[field]) if r else math.nan for r in found]
                errors = [half_width(r, field) if r else 0 for r in found]
                name = "here: " + OURS[variant]
            drawn = panel.bar(places, values, width, yerr=errors, capsize=2, label=name,
                              color=colors[paper or variant])
            panel.bar_label(drawn, ["" if math.isnan(v) else f"{v:.0f}" for v in values], fontsize=7,
                            padding=2)
        panel.axhline(100, color="black", linewidth=0.8)
        panel.set_xticks(range(len(scenes)),
                         [s if s not in STANDS_IN else f"{s} (for {STANDS_IN[s]})" for s in scenes])
        panel.margins(y=0.1)
        panel.set_title(f"{title}, percent of the baseline")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="lower center", ncol=2, fontsize=8)
    figure.suptitle("Table 1: image photons, leaves of one photon, searches for the photon itself")
    save(figure, folder, "table1", (0, 0.2, 1, 1))


def leaf_sizes(rows, folder):
    rows = [r for r in rows if r["set"] == "light"]
    if not rows:
        return
    fewest = min(int(r["photons"]) for r in rows)
    rows = [r for r in rows if int(r["photons"]) == fewest]
    scenes = unique(r["scene"] for r in rows)
    if len({r["leaf_size"] for r in rows}) < 3:
        return
    figure, panels = pyplot.subplots(2, len(scenes), figsize=(4.2 * len(scenes), 7.4), squeeze=False)
    for column, scene in enumerate(scenes):
        for panel, nodes, tests, title in (
                (panels[0][column], "knn50_nodes", "knn50_tests", "the 50 nearest"),
                (panels[1][column], "r50_nodes", "r50_tests", "all within their distance")):
            sums = collections.defaultdict(list)
            for r in rows:
                if r["scene"] != scene:
                    continue
                size, name = int(r["leaf_size"]), label(r)
                names = {name, CURVES_OF_ONE.get(name, name)} if size == 1 else {name}
                for curve in names:
                    sums[curve, size].append((float(r[tests]), float(r[nodes])))
            for variant, (name, color, line) in CURVES.items():
                sizes = sorted(size for curve, size in sums if curve == variant)
                if len(sizes) < 3:
                    continue
                points = [[sum(c) / len(c) for c in zip(*sums[variant, size])] for size in sizes]
                panel.loglog(*zip(*points), line, color=color, marker="o", markersize=3, label=name)
                if variant in ("lbvh", "hybrid isa+leaf 256"):
                    for size, point in zip(sizes, points):
                        panel.annotate(str(size), point, fontsize=6, color=color,
                                       xytext=(3, 3), textcoords="offset points")
            panel.set_title(f"{scene}: {title}")
            panel.set_xlabel("distance tests")
            panel.set_ylabel("nodes visited")
            panel.grid(True, which="both", alpha=0.25)
    panels[0][0].legend(fontsize=7)
    figure.suptitle(f"Leaf sizes 1 to 48 (numbers), {fewest} light photons: below is better at equal work")
    save(figure, folder, "leaf_sizes")


def build_times(summary, all_rows, folder):
    devices = ", ".join(unique(r["device"] for r in all_rows))
    rows = [r for r in summary if r["set"] == "light" and r["leaf_size"] == "8"]
    counts = unique(r["photons"] for r in rows)
    if not rows:
        return
    figure, panels = pyplot.subplots(1, len(counts), figsize=(6.4 * len(counts), 5), squeeze=False)
    for panel, count in zip(panels[0], counts):
        means = collections.defaultdict(list)
        for r in rows:
            if r["photons"] == count:
                means[r["variant"]].append((float(r["build_ms"]), float(r["knn50_speed"])))
        for variant, values in means.items():
            x, y = (sum(v) / len(v) for v in zip(*values))
            panel.plot(x, y, "o", markersize=4, color="#1f77b4")
            panel.annotate(variant, (x, y), fontsize=6, xytext=(3, 2), textcoords="offset points")
        panel.set_xscale("log")
        panel.margins(x=0.25)  # for the names
        panel.axhline(100, color="black", linewidth=0.8)
        panel.set_xlabel("time of the build, ms")
        panel.set_ylabel("speed of searches for the 50 nearest, percent of the baseline")
        panel.set_title(f"{count} light photons, leaves of 8, mean of the scenes\n{devices}", fontsize=8)
        panel.grid(True, which="both", alpha=0.25)
    save(figure, folder, "build_times")


def main(folder, paths):
    summary = read(f"{folder}/summary.csv", "a summary", ())
    rows = [row for path in paths for row in read(path, "a study", ())]
    table1(summary, folder)
    leaf_sizes(rows, folder)
    build_times(summary, rows, folder)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2:])
