#!/usr/bin/env python3
"""Draws latency and answers/s against the offered load as PNG and SVG: charts.py FOLDER LOAD.csv...

One line for each percentile of each kind of request, from the runs of the open loop. A point without a p99, since more
than 1 % of the sends were late and the tail would be that of the tool, or answers were too few, is hollow. Runs that were
interrupted are left out. The vertical line is what the closed loop reached. Needs python3-matplotlib. `treelight load --output` runs this.
"""
import sys

from chart_style import pyplot, read, save

COLORS = {"gather": "#1f77b4", "build": "#d62728"}
PERCENTILES = (("p50_ms", "-", "50 %"), ("p99_ms", "--", "99 %"), ("p999_ms", ":", "99.9 %"))
NUMBERS = ("offered_per_s", "ok", "ok_per_s", "p50_ms", "p99_ms", "p999_ms")


def latencies(axes, rows):
    for kind in sorted({row["kind"] for row in rows}):
        of_kind = [row for row in rows if row["kind"] == kind]
        for column, line, name in PERCENTILES:
            points = [(row["offered_per_s"], row[column]) for row in of_kind if row[column] is not None]
            if points:
                axes.plot(*zip(*points), line, marker="o", markersize=4, color=COLORS[kind], label=f"{kind} {name}")
        late = [(row["offered_per_s"], row["p50_ms"]) for row in of_kind if row["p99_ms"] is None and row["p50_ms"]]
        if late:
            axes.plot(*zip(*late), "o", markersize=4, zorder=3, markerfacecolor="white", markeredgecolor=COLORS[kind])
    axes.set_yscale("log")
    for formatter in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
        formatter("{x:g}")
    axes.yaxis.get_minor_locator().set_params(subs=(2, 5))
    axes.set_ylabel("latency from the intended time, ms")


def together(rows):
    """Answers/s of both kinds, by what the run has offered."""
    sums = {}
    for row in rows:
        sums[row["offered_per_s"]] = sums.get(row["offered_per_s"], 0) + row["ok_per_s"]
    return sums


def answers(axes, rows):
    sums = together(rows)
    axes.plot(list(sums), list(sums.values()), "-", marker="o", markersize=4, color="#2ca02c", label="open loop")
    axes.plot([0, max(sums)], [0, max(sums)], color="#aaaaaa", linewidth=0.8, zorder=0, label="all of them")
    axes.set_ylim(bottom=0)
    axes.set_ylabel("answered requests/s")


folder = sys.argv[1]
all_rows = [row for path in sys.argv[2:] for row in read(path, "a load", NUMBERS, ("kind", "loop"), may_be_empty=True)]
runs = sorted((row for row in all_rows if row["loop"] == "open" and row["ok"]), key=lambda row: row["offered_per_s"])
if not runs:
    sys.exit("no run of the open loop (--rates, --sweep) was answered")
figure, panels = pyplot.subplots(1, 2, figsize=(10, 4.2))
latencies(panels[0], runs)
answers(panels[1], runs)
capacity = together([row for row in all_rows if row["loop"] == "closed"])
for panel in panels:
    for rate in capacity.values():
        panel.axvline(rate, color="#888888", linestyle="-.", linewidth=0.8, label="closed loop")
    panel.set_xlabel("offered requests/s")
    panel.set_xlim(left=0)
    panel.grid(alpha=0.3)
    panel.legend()
save(figure, folder, "load")
