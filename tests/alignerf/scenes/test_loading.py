"""Loading photos for training keeps one copy of them in memory."""

import json
import subprocess
import sys

from tools.bench import memory

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
    memory.write_scene(tmp_path / "scene", COUNT, WIDTH, HEIGHT)
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
