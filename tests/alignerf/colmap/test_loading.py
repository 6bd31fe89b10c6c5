"""Loading photos for training keeps one copy of them in memory."""

import json
import os
import subprocess
import sys

import numpy as np

from alignerf.io import images
from tools.bench import cases

COUNT, WIDTH, HEIGHT = 60, 800, 600
SCRIPT = """
import json, pathlib, sys
import jax
from alignerf.scenes import prepared
from alignerf.processes import devices
from alignerf.training import batches, checkpoint

def resident(key):
    lines = pathlib.Path("/proc/self/status").read_text().splitlines()
    return 1024 * int(dict(line.split(":", 1) for line in lines)[key].split()[0])

loaded = prepared.load(sys.argv[1])
chosen = loaded.views("train")
jax.block_until_ready(jax.numpy.ones(3))
before = resident("VmRSS")
views = batches.load_views(loaded, chosen, loaded.folder / "images", None)
checkpoint.digest(views)
placed = devices.place(views, None)
assert placed.photos.unsafe_buffer_pointer() == views.photos.ctypes.data
print(json.dumps([resident("VmHWM") - before, placed.photos.nbytes]))
"""


def test_one_copy_of_the_photos_is_resident(root, tmp_path):
    write_scene(tmp_path / "scene", COUNT, WIDTH, HEIGHT)
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, tmp_path / "scene"],
        cwd=root,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    taken, photos = json.loads(done.stdout)
    assert photos == COUNT * WIDTH * HEIGHT * 3
    assert 0.9 * photos < taken < 1.3 * photos


def write_scene(folder, count, width, height):
    """A prepared scene of `count` training views that share one file of noise."""
    found = cases.orbit(count, 4, 4)
    (folder / "images").mkdir(parents=True)
    names = [f"view{number:04d}" for number in range(count)]
    first = folder / "images" / f"{names[0]}.png"
    images.write(first, cases.orbit(1, width, height).images[0])
    for name in names[1:]:
        os.link(first, folder / "images" / f"{name}.png")
    np.savez(
        folder / "cameras.npz",
        pixtocams=np.tile(cases.orbit(1, width, height).pixtocams, (count, 1, 1)),
        camtoworlds=found.camtoworlds,
        names=names,
        width=width,
        height=height,
        split=["train"] * count,
    )
