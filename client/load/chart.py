#!/usr/bin/env python3
"""Draws latency against offered load from what `treelight load --csv` wrote: chart.py LOAD.csv CHART.png

One line for each percentile of each kind of request. A point where more than 1 % of the sends were late is hollow, and has
no p99: the tail would be that of the tool. Needs python3-matplotlib.
"""
import csv
import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

COLORS = {"gather": "#1f77b4", "build": "#d62728"}

with open(sys.argv[1], newline="") as file:
    rows = [row for row in csv.DictReader(file) if int(row["ok"]) > 0]
figure, axes = pyplot.subplots(figsize=(7, 4.5))
for kind in sorted({row["kind"] for row in rows}):
    for percentile, line in (("p50_ms", "-"), ("p99_ms", "--"), ("p999_ms", ":")):
        points = [(float(row["offered_per_s"] or row["ok_per_s"]), float(row[percentile]), row)
                  for row in rows if row["kind"] == kind and row[percentile]]
        points.sort(key=lambda point: point[0])
        if not points:
            continue
        axes.plot([p[0] for p in points], [p[1] for p in points], line, marker="o",
                  color=COLORS[kind], markersize=5, label=f"{kind} {percentile[:-3].replace('999', '99.9')}")
        late = [p for p in points if not p[2]["p99_ms"]]
        axes.plot([p[0] for p in late], [p[1] for p in late], "o", markersize=5, zorder=3,
                  markerfacecolor="white", markeredgecolor=COLORS[kind])
axes.set_xlabel("offered requests/s")
axes.set_ylabel("latency from the intended time, ms")
axes.set_yscale("log")
axes.grid(alpha=0.3)
axes.legend()
figure.tight_layout()
figure.savefig(sys.argv[2], dpi=150)
