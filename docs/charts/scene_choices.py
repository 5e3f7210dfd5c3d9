#!/usr/bin/env python3
"""What `--builder auto` takes for the photon maps of scenes, beside every tree that it may take.

    scene_choices.py measure TREELIGHT SERVER PID DEVICE PHOTONS QUERIES SCENE...   # appends rows to scene_choices.csv
    scene_choices.py table                                                          # sums them up

PID is the process of the server: times are those of all its cores, so that others on the machine count less. Photons are the
indirect ones of a scene, queries diffuse hits of paths from its camera, k 100 for a density without a limit to the radius. All
trees take turns.
"""
import collections
import csv
import glob
import json
import os
import statistics
import subprocess
import sys
import tempfile

CSV = os.path.dirname(os.path.abspath(__file__)) + "/scene_choices.csv"
COLUMNS = ["device", "scene", "photons", "queries", "tree", "build_ms", "gather_us"]
TREES = {f"{builder} {leaf} {bits}": ["--builder", builder, "--leaf-size", str(leaf), "--morton-bits", str(bits), *more]
         for builder, leaf, more in (("lbvh", 16, []), ("lbvh", 32, []), ("lbvh", 64, []),
                                     ("hybrid", 32, ["--subtree-size", "512"]))
         for bits in (30, 63)}
TURNS, K = 5, 100


def cpu_ms(pid):
    total = 0
    for path in glob.glob(f"/proc/{pid}/task/*/schedstat"):
        try:
            with open(path) as file:
                total += int(file.read().split()[0])
        except OSError:  # a thread that ended
            pass
    return total / 1e6


def measure(treelight, server, pid, device, photons, queries, scenes):
    new = not os.path.exists(CSV)
    with open(CSV, "a", newline="") as file, tempfile.TemporaryDirectory() as folder:
        out = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if new:
            out.writeheader()

        def run(*arguments):
            before = cpu_ms(pid)
            done = subprocess.run([treelight, "--server", server, *arguments], check=True, stdout=subprocess.PIPE, text=True)
            return cpu_ms(pid) - before, done.stdout

        for scene in scenes:
            name = os.path.splitext(os.path.basename(scene))[0]
            run("trace", "--scene", scene, "--photons", photons, "--caustic-photons", "0", "--output", folder + "/photons.ply")
            run("trace", "--scene", scene, "--image-photons", "--photons", queries, "--output", folder + "/queries.ply")
            run("build", "--photons", folder + "/photons.ply", "--name", "choices.source")
            times = collections.defaultdict(lambda: ([], []))
            chosen = {}
            for turn in range(TURNS + 1):
                ways = dict(TREES)
                for gathers in ("1e5", "1e6", "1e7", "1e8"):
                    ways["auto " + gathers] = ["--builder", "auto", "--expected-gathers", str(int(float(gathers))),
                                               "--expected-k", str(K)]
                for tree, options in ways.items():
                    ms, text = run("rebuild", "--map", "choices.source", "--name", "choices.tree", "--json", *options)
                    if tree.startswith("auto"):
                        made = json.loads(text)["map"]["options"]
                        chosen[tree] = (made["builder"].rsplit("_", 1)[1].lower() + f" {made['max_leaf_size']} "
                                        + str(made["morton_bits"]))
                        continue
                    gather_ms, _ = run("gather", "--map", "choices.tree", "--queries", folder + "/queries.ply", "--k", str(K),
                                       "--outputs", "density", "--output", folder + "/answers.csv")
                    if turn > 0:  # the first one compiles, and fills caches
                        times[tree][0].append(ms)
                        times[tree][1].append(1e3 * gather_ms / int(queries))
            known = {"device": device, "scene": name, "photons": photons, "queries": queries}
            for tree, (build, gather) in times.items():
                out.writerow({**known, "tree": tree, "build_ms": f"{statistics.median(build):.2f}",
                              "gather_us": f"{statistics.median(gather):.4f}"})
            for gathers, tree in chosen.items():
                out.writerow({**known, "tree": f"{gathers}: {tree}", "build_ms": "", "gather_us": ""})
            file.flush()
            run("maps", "delete", "choices.source")
            run("maps", "delete", "choices.tree")


def table():
    with open(CSV, newline="") as file:
        rows = list(csv.DictReader(file))
    for device, scene in dict.fromkeys((row["device"], row["scene"]) for row in rows):
        here = [row for row in rows if (row["device"], row["scene"]) == (device, scene)]
        trees = {row["tree"]: row for row in here if row["build_ms"]}
        for row in here:
            if row["build_ms"]:
                continue
            gathers, chosen = row["tree"].removeprefix("auto ").split(": ")

            def cost(tree):
                return float(trees[tree]["build_ms"]) + float(gathers) * float(trees[tree]["gather_us"]) / 1e3

            best = min(trees, key=cost)
            print(f"{device}, {scene}, {gathers} gathers: auto {chosen} {cost(chosen):.1f} ms, best {best} {cost(best):.1f} ms, "
                  f"ratio {cost(chosen) / cost(best):.3f}; default lbvh 16 30 {cost('lbvh 16 30') / cost(best):.3f}")


if __name__ == "__main__":
    if len(sys.argv) > 8 and sys.argv[1] == "measure":
        measure(*sys.argv[2:8], sys.argv[8:])
    elif sys.argv[1:] == ["table"]:
        table()
    else:
        sys.exit(__doc__)
