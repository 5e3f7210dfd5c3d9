#!/usr/bin/env python3
"""Renders the gallery: each scene by photon maps, by path tracing, and the difference of both.

    gallery.py render TREELIGHT SERVER SCENES_FOLDER OUTPUT_FOLDER [NAME...]
    gallery.py page OUTPUT_FOLDER DOCS_GALLERY_FOLDER "MACHINE" >docs/gallery.md

`render` needs a running treelightd at SERVER, and TREELIGHT_SCENES where the files of SCENES_FOLDER
should find their meshes; scenes whose meshes are not there are left out, and it says so. `page` needs
python3-pil.
"""
import os
import re
import shlex
import subprocess
import sys

SIZE = ["--width", "480", "--height", "360"]
MAPS = ["--spp", "32", "--final-gather", "16"]

# Name, scene, what it shows, options of the picture, of the reference.
SCENES = [
    ("cornell", "cornell", "Built in: diffuse walls, a mirror and a glass sphere, an area light.", [], []),
    ("caustic", "caustic", "Built in: a metal ring and a glass ball on a plane; the ring's caustic has its cusp.",
     ["--caustic-photons", "2000000"], []),
    ("hall", "hall", "Built in: a colonnade lit through its windows; nearly all light is indirect.", [], []),
    ("room", "room", "Built in: a meeting room, 18 lamps, many small things.", [], []),
    ("blob", "blob", "Built in: a glossy, curved, closed mesh on a ground.", [], []),
    ("cornell-original", "cornell-original.json", "McGuire's Cornell box.", [], []),
    ("cornell-sphere", "cornell-sphere.json", "The same with a mirror and a glass sphere, both meshes with smooth normals.", [], []),
    ("cornell-water", "cornell-water.json", "The same over water.", ["--caustic-photons", "2000000"], []),
    ("cornell-glossy", "cornell-glossy.json", "The same with a glossy sphere.", [], []),
    ("sibenik", "sibenik.json", "Sibenik cathedral, one point light. Marko Dabrovic; holes mended by Kenzie Lamar.",
     [], ["--allow-incomplete"]),
    ("conference", "conference.json", "LBL conference room, its 24 ceiling lights. Anat Grynberg and Greg Ward.", [], []),
    ("dragon", "dragon.json", "Stanford dragon, 871,306 triangles, glossy. Stanford Computer Graphics Laboratory.", [], []),
    ("mncardioid", "mncardioid.json", "MNCardioid: a mirroring cylinder and a point light. Mathias Neumann. "
     "Light by way of the mirror is missing from the reference: no path meets a point light.",
     ["--caustic-photons", "2000000"], ["--allow-incomplete"]),
]
REFERENCE = ["--reference", "--spp", "256"]


def run(command, log):
    with open(log, "w") as file:
        file.write("$ " + shlex.join(command) + "\n")
        file.flush()
        return subprocess.run(command, stdout=file, stderr=subprocess.STDOUT).returncode


def render(treelight, server, scenes, output, only):
    os.makedirs(output, exist_ok=True)
    for name, scene, _, options, reference_options in SCENES:
        if only and name not in only:
            continue
        at = os.path.join(output, name)
        path = os.path.join(scenes, scene) if scene.endswith(".json") else scene
        base = [treelight, "--server", server, "render", "--scene", path, *SIZE]
        if run([*base, *MAPS, *options, "--output", at + ".exr", "--output", at + ".png"], at + ".log"):
            print(f"{name}: left out: {open(at + '.log').read().splitlines()[-1]}", file=sys.stderr)
            continue
        run([*base, *REFERENCE, *reference_options, "--output", at + "_reference.exr", "--output", at + "_reference.png"],
            at + "_reference.log")
        run([treelight, "compare", at + ".exr", at + "_reference.exr", "--difference", at + "_difference.png"],
            at + "_compare.log")
        print(name, open(at + "_compare.log").read().splitlines()[-2], flush=True)


def page(output, docs, machine):
    from PIL import Image

    print("# Gallery\n")
    print("Left: by photon maps; middle: path-traced; right: the difference, red where the photon maps are brighter, blue")
    print("where they are darker. 480 x 360 pixels. Made by [gallery/gallery.py](gallery/gallery.py) with")
    print(f"`treelight render {shlex.join(MAPS)}` and 1e6 photons in the indirect map, on {machine}.")
    print("The meshes that are not built in, and their terms, are the authors' named below.\n")
    for name, scene, text, options, _ in SCENES:
        at = os.path.join(output, name)
        try:
            log, compared, reference = (open(at + end).read() for end in (".log", "_compare.log", "_reference.log"))
            error = re.search(r"RMSE (\S+) \((\S+) .*relative MSE ([^,]+), mean (\S+) %", compared).groups()
            photons = re.search(r"^photons +(\S+) +(\S+)", log, re.M)
            photons = photons.groups() if photons else (re.search(r"^photons +(\S+)", log, re.M).group(1), "0")
            times = re.search(r"time: photons (\S+) s .*picture (\S+) s, in all (\S+) s", log).groups()
            traced = re.search(r"path-traced with (\S+) samples per pixel in (\S+) s.*noise (\S+) ", reference).groups()
        except (OSError, AttributeError):
            print(f"{name}: not rendered", file=sys.stderr)
            continue
        pictures = [Image.open(at + end).convert("RGB") for end in (".png", "_reference.png", "_difference.png")]
        strip = Image.new("RGB", (3 * pictures[0].width, pictures[0].height))
        for i, picture in enumerate(pictures):
            strip.paste(picture, (i * pictures[0].width, 0))
        strip.save(os.path.join(docs, name + ".jpg"), quality=88)
        scene_option = "scenes/" + scene if scene.endswith(".json") else scene
        print(f"## {name}\n\n{text}\n\n![{name}](gallery/{name}.jpg)\n")
        print(f"`treelight render --scene {scene_option} {shlex.join([*SIZE, *MAPS, *options])}`\n")
        print("| photons, indirect / caustic | seconds: photons, picture, in all | reference: samples, seconds, noise | "
              "RMSE (clipped at 1) | relative MSE | mean |\n|--:|--:|--:|--:|--:|--:|")
        print(f"| {photons[0]} / {photons[1]} | {times[0]}, {times[1]}, {times[2]} | {', '.join(traced)} | "
              f"{error[0]} ({error[1]}) | {error[2]} | {error[3]} % |\n")


if __name__ == "__main__":
    if len(sys.argv) > 5 and sys.argv[1] == "render":
        render(*sys.argv[2:6], sys.argv[6:])
    elif len(sys.argv) == 6 and sys.argv[1] == "render":
        render(*sys.argv[2:6], [])
    elif len(sys.argv) == 5 and sys.argv[1] == "page":
        page(*sys.argv[2:5])
    else:
        sys.exit(__doc__)
