"""What `make photos` takes: minutes, memory and disk, by stage and number of photos.

The captures are made from those in --data: their photos, enlarged to the size that is
wanted; where there are too few, each gives several, cut out beside one another. A
capture whose results are there goes on, and then its minutes are too few.
"""

import csv
import math
import shutil
import subprocess
import sys
import time
from typing import NamedTuple

from PIL import Image

from alignerf.io import machine
from tools.bench import measure


class Capture(NamedTuple):
    """So many photos of a size in px, of a folder of photos in the data."""

    scene: str
    count: int
    size: tuple[int, int]


CAPTURES = (
    Capture("chair/images", 24, (1920, 1440)),
    Capture("fox/images", 50, (1080, 1920)),
    Capture("treehill/images", 150, (2432, 1600)),
    Capture("treehill/images", 300, (4000, 3000)),
)
QUICK = Capture("chair/images", 12, (480, 360))
# Of photos that are cut out, the side over that of the whole.
CUT = 0.75
# Rules by what a user waits for; all others are `other`, those of crops `crops`.
STAGES = {
    "COLMAP": ("poses",),
    "trainings": ("train",),
    "renders": ("render", "render_test"),
    "flow": ("align", "control_sets", "testset", "decompose"),
    "verdict and page": ("verdict", "page", "draw", "tables"),
    "export": ("export",),
}
SUFFIXES = (".jpg", ".jpeg", ".png")


def run(options, captures=CAPTURES):
    """Rows of each capture: the whole run, then its stages."""
    return [
        row
        for capture in ((QUICK,) if options.quick else captures)
        for row in rows_of(capture, options)
    ]


def rows_of(capture, options):
    """Minutes, memory and disk of one capture."""
    name = f"photos_{capture.count}"
    folder = (options.out / "photos" / name).absolute()
    if not folder.is_dir():
        make(options.data / "scenes" / capture.scene, capture, folder)
    command = [sys.executable, "-m", "alignerf.cli", "--cores", machine.cores()]
    begun = time.perf_counter()
    done = subprocess.run([*map(str, command), "--", str(folder)], cwd=measure.ROOT)
    took_s = time.perf_counter() - begun
    if done.returncode:
        raise ValueError(f"{folder}: make photos ended with {done.returncode}")
    width, height = capture.size
    what = f"{capture.count} photos of {width * height / 1e6:.1f} MP"
    of_capture = sorted((measure.ROOT / "results").glob(f"{name}*/"))
    yield row(f"{what}, all", "min", took_s / 60)
    files = (path for one in of_capture for path in one.rglob("*") if path.is_file())
    yield row(f"{what}, disk", "GB", sum(p.stat().st_size for p in files) / 1e9)
    stages = stages_of(name, of_capture)
    yield row(f"{what}, memory", "GB", max(s[1] for s in stages.values()) / 1e3)
    for stage, (seconds, _) in stages.items():
        yield row(f"{what}, {stage}", "min", seconds / 60)


def row(what, unit, value):
    return measure.Row(what, unit, measure.one(value))


def stages_of(name, results):
    """{stage: (seconds of all its jobs, most MB of one)}, of Snakemake's benchmarks.

    results: the folder of the scene `name`, and those of its crops. Two jobs may have
    run at once: the sum may be longer than the run.
    """
    found = {stage: (0.0, 0.0) for stage in (*STAGES, "crops", "other")}
    by_rule = {rule: stage for stage, rules in STAGES.items() for rule in rules}
    for path in (path for folder in results for path in folder.rglob("logs/*.tsv")):
        with open(path, newline="", encoding="utf-8") as file:
            (line,) = csv.DictReader(file, delimiter="\t")
        stem, is_whole = path.stem, (measure.ROOT / "results" / name) in path.parents
        stage = by_rule.get(stem, by_rule.get(stem.split("_")[0], "other"))
        stage = stage if is_whole else "crops"
        memory_mb = float(line["max_rss"]) if line["max_rss"] != "NA" else 0.0
        seconds, max_mb = found[stage]
        found[stage] = seconds + float(line["s"]), max(max_mb, memory_mb)
    return found


def make(source, capture, folder):
    """Write the photos of a capture; in place only when all are there."""
    paths = sorted(p for p in source.iterdir() if p.suffix.lower() in SUFFIXES)
    copies = math.ceil(capture.count / len(paths))
    partial = folder.with_name(folder.name + ".part")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    wanted = [(path, copy) for copy in range(copies) for path in paths]

    def write(one):
        path, copy = one
        with Image.open(path) as photo:
            box = (0, 0, *photo.size)
            if copies > 1:
                box = cut(photo.size, copy / (copies - 1), capture.size)
            image = photo.convert("RGB").resize(capture.size, Image.LANCZOS, box)
        image.save(partial / f"{path.stem}_{copy}.jpg", quality=92)

    for _ in machine.map_in_threads(write, wanted[: capture.count]):
        pass
    partial.rename(folder)


def cut(size, place, shape):
    """The box of a part in the shape that is wanted, from the left (0) to the right."""
    aspect = shape[0] / shape[1]
    height = min(size[1], CUT * size[0] / aspect)
    width = height * aspect
    left = place * (size[0] - width)
    top = (size[1] - height) / 2
    return left, top, left + width, top + height
