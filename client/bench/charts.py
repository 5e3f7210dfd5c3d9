#!/usr/bin/env python3
"""Draws the charts of a bench as PNG and SVG: charts.py FOLDER BENCH.csv...

Points are medians, bars reach from the least to the largest. A builder is shown at its best leaf size of each place, by
the median. Needs python3-matplotlib. `treelight bench` runs this.
"""
import collections
import sys

from chart_style import pyplot, read, save, unique

COLORS = ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#8c564b", "#17becf", "#7f7f7f"]
NUMBERS = ("photons", "k", "radius", "queries", "threads", "leaf_size", "per_second", "device_min_ms", "device_median_ms",
           "device_max_ms")
TEXTS = ("figure", "name", "set", "fresh", "builder", "answers", "order", "machine", "device")


def colored(names):
    return {name: COLORS[i % len(COLORS)] for i, name in enumerate(unique(names))}


def where(rows):
    """The processors and devices of the rows, for a title."""
    machines, devices = (", ".join(unique(row[column] for row in rows)) for column in ("machine", "device"))
    return f"{devices}\nin {machines}" if devices not in machines else machines


def best(rows, keys):
    """The row of the least median for each value of `keys`."""
    found = {}
    for row in rows:
        key = tuple(row[k] for k in keys)
        if key not in found or row["device_median_ms"] < found[key]["device_median_ms"]:
            found[key] = row
    return list(found.values())


def line(panel, rows, x, value, **style):
    """Medians of `value` (a function of milliseconds and row) over the column `x`, with least and largest."""
    rows = sorted(rows, key=lambda row: row[x])
    middle, low, high = ([value(row[f"device_{part}_ms"], row) for row in rows] for part in ("median", "min", "max"))
    low, high = zip(*(sorted(pair) for pair in zip(low, high)))
    errors = [[max(0, m - l) for m, l in zip(middle, low)], [max(0, h - m) for m, h in zip(middle, high)]]
    panel.errorbar([row[x] for row in rows], middle, yerr=errors, capsize=2, marker="o", markersize=3, **style)


def panels_for(titles, width=5.2, height=4.4):
    figure, panels = pyplot.subplots(1, len(titles), figsize=(max(7.5, width * len(titles)), height), squeeze=False)
    for panel, title in zip(panels[0], titles):
        panel.set_title(title)
        panel.grid(True, which="major", alpha=0.3)
    return figure, panels[0]


def save_titled(figure, folder, name, title):
    figure.suptitle(title, fontsize=10)
    save(figure, folder, name)


def all_threads(rows):
    """Without what was measured to vary the threads."""
    most = max((row["threads"] for row in rows), default=0)
    return [row for row in rows if row["threads"] == most]


def builds(rows, folder):
    rows = [row for row in all_threads(rows) if row["figure"] in ("build", "floor")]
    if not any(row["figure"] == "build" for row in rows):
        return
    sets = unique(row["set"] for row in rows)
    figure, panels = panels_for(sets)
    colors = colored(row["builder"] for row in rows if row["figure"] == "build")
    floors = unique(row["name"] for row in rows if row["figure"] == "floor")
    for panel, name in zip(panels, sets):
        own = [row for row in rows if row["set"] == name]
        for builder, color in colors.items():
            found = [r for r in best(own, ("figure", "builder", "photons")) if r["builder"] == builder and r["figure"] == "build"]
            if found:
                line(panel, found, "photons", lambda ms, _: ms, color=color, label=builder)
        for floor, style in zip(floors, ("--", ":", "-.")):
            found = best([r for r in own if r["figure"] == "floor" and r["name"] == floor], ("photons",))
            if found:
                line(panel, found, "photons", lambda ms, _: ms, color="#777777", linestyle=style, label=f"floor: {floor}")
        panel.set(xscale="log", yscale="log", xlabel="photons", ylabel="ms on the device's clock")
        panel.legend(fontsize=7)
    save_titled(figure, folder, "builds", f"Builds, each at its best leaf size: {where(rows)}")


def stages(rows, folder):
    rows = all_threads(rows)
    whole = best([r for r in rows if r["figure"] == "build"], ("set", "builder", "photons"))
    parts = {}
    for row in rows:
        if row["figure"] == "stage" and row["name"] != "upload":
            key = (row["set"], row["builder"], row["leaf_size"], row["photons"])
            parts.setdefault(key, {}).setdefault(row["name"], row)
    parts = {key: list(found.values()) for key, found in parts.items()}
    if max((len(found) for found in parts.values()), default=0) < 2:
        return
    sets = unique(row["set"] for row in whole)
    figure, panels = panels_for(sets, width=6)
    colors = colored(row["name"] for found in parts.values() for row in found)
    palette = pyplot.get_cmap("tab20").colors
    colors = {name: palette[i % len(palette)] for i, name in enumerate(colors)}
    for panel, name in zip(panels, sets):
        bars = sorted((row for row in whole if row["set"] == name), key=lambda r: (r["builder"], r["photons"]))
        seen = set()
        for place, row in enumerate(bars):
            bottom = 0
            found = parts.get((name, row["builder"], row["leaf_size"], row["photons"]), [])
            total = sum(part["device_median_ms"] for part in found) or 1
            for part in found:
                share = 100 * part["device_median_ms"] / total
                label = part["name"] if part["name"] not in seen else None
                seen.add(part["name"])
                panel.bar(place, share, 0.8, bottom, color=colors[part["name"]], label=label)
                bottom += share
            panel.annotate(f"{row['device_median_ms']:.3g} ms", (place, 101), ha="center", fontsize=6, rotation=30)
        panel.set_xticks(range(len(bars)), [f"{r['builder']} ({r['leaf_size']:.0f})\n{r['photons']:.0e}".replace("e+0", "e") for r in bars],
                         fontsize=6, rotation=60)
        panel.set(ylabel="percent of the stages", ylim=(0, 112))
        panel.legend(fontsize=6, loc="upper left", bbox_to_anchor=(1, 1))
    save_titled(figure, folder, "stages", f"What builds consist of: {where(rows)}")


def gathers_over_k(rows, folder):
    rows = [r for r in all_threads(rows) if r["figure"] == "gather" and r["answers"] == "lists" and r["order"] == "random"]
    ks = collections.Counter()
    for row in best(rows, ("set", "photons", "k", "radius")):
        ks[row["photons"]] += 1
    if not ks:
        return
    photons = ks.most_common(1)[0][0]
    rows = [row for row in rows if row["photons"] == photons]
    if len({row["k"] for row in rows}) < 3:
        return
    sets = unique(row["set"] for row in rows)
    figure, panels = panels_for(sets)
    colors = colored(row["builder"] for row in rows)
    for panel, name in zip(panels, sets):
        for builder, color in colors.items():
            for within, style, label in ((False, "-", "no radius"), (True, "--", "in r1")):
                found = [r for r in rows if (r["set"], r["builder"]) == (name, builder) and (r["radius"] != float("inf")) == within]
                if found:
                    line(panel, best(found, ("k",)), "k", lambda ms, r: 1e-3 * r["queries"] / ms, color=color,
                         linestyle=style, label=f"{builder}, {label}")
        panel.set(xscale="log", yscale="log", xlabel="k", ylabel="M gathers/s of the device's time")
        panel.legend(fontsize=7)
    save_titled(figure, folder, "gathers_over_k",
         f"Gathers of ids and distances, {photons:.0e} photons, random order: {where(rows)}".replace("e+0", "e"))


def gathers_over_photons(rows, folder):
    rows = [r for r in all_threads(rows) if r["figure"] == "gather"]
    counts = {row["photons"] for row in rows}
    names = [name for name in unique(row["name"] for row in rows)
             if {row["photons"] for row in rows if row["name"] == name} == counts]
    if len(counts) < 2 or not names:
        return
    sets = unique(row["set"] for row in rows)
    figure, panels = panels_for(sets)
    colors = colored(names)
    for panel, name in zip(panels, sets):
        for search, color in colors.items():
            for order, style in (("random", "-"), ("sorted", ":")):
                found = [r for r in rows if (r["set"], r["name"], r["order"]) == (name, search, order)]
                if found:
                    line(panel, best(found, ("photons",)), "photons", lambda ms, r: 1e6 * ms / r["queries"], color=color,
                         linestyle=style, label=f"{search}, {order}")
        panel.set(xscale="log", yscale="log", xlabel="photons", ylabel="ns a gather of the device's time")
        panel.legend(fontsize=6)
    save_titled(figure, folder, "gathers_over_photons", f"What a gather costs, each in its best tree: {where(rows)}")


def threads(rows, folder):
    rows = [row for row in rows if row["figure"] in ("build", "gather") and row["threads"] > 0]
    groups = collections.defaultdict(list)
    for row in rows:
        label = row["builder"] if row["figure"] == "build" else row["name"]
        groups[row["set"], row["photons"], row["figure"], label, row["builder"], row["order"], row["leaf_size"]].append(row)
    groups = {key: found for key, found in groups.items() if len({row["threads"] for row in found}) > 1}
    if not groups:
        return
    sets = unique(key[0] for key in groups)
    figure, panels = panels_for(sets)
    colors = colored((key[2], key[3]) for key in groups)
    for panel, name in zip(panels, sets):
        most = 1
        for key, found in groups.items():
            if key[0] != name:
                continue
            found = best(found, ("threads",))
            first = min(found, key=lambda row: row["threads"])
            most = max(most, *(row["threads"] for row in found))
            text = f"build {key[3]}" if key[2] == "build" else f"{key[3]}, {key[4]}"
            line(panel, found, "threads", lambda ms, _, first=first: first["device_median_ms"] * first["threads"] / ms,
                 color=colors[key[2], key[3]], linestyle="-" if key[2] == "build" else "--", label=text)
        panel.plot([1, most], [1, most], color="#777777", linewidth=0.8, label="as many times as fast")
        panel.set_xticks(sorted({row["threads"] for found in groups.values() for row in found}))
        panel.set(xlabel="threads", ylabel="times as fast as on the fewest")
        panel.legend(fontsize=7)
    save_titled(figure, folder, "threads", f"Threads of the CPU: {where(rows)}")


def main(folder, paths):
    rows = [row for path in paths for row in read(path, "a bench", NUMBERS, TEXTS) if row["fresh"] == "0"]
    for chart in (builds, stages, gathers_over_k, gathers_over_photons, threads):
        chart(rows, folder)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2:])
