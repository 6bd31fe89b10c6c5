"""Peak resident memory of a training on 170 photos of 2560 x 1680.

`python -m alignerf.train` with a few steps of the default model, in a process of its
own; what another holds at its end, of one tiny photo, is what Python, JAX, the step
and its activations take. The photos are one file of noise under many names: each is
decoded all the same.
"""

import json
import os
import pathlib
import sys
import tempfile

import numpy as np

from alignerf import train
from alignerf.io import images
from tools.bench import cases, measure

STEPS = 5


def run(options):
    """Rows: the peaks over the photos' size as uint8."""
    count, width, height = (40, 1024, 672) if options.quick else (170, 2560, 1680)
    job = cases.make_job(
        cases.TINY if options.quick else cases.GRID,
        batch_rays=16 if options.quick else 1024,
        steps=STEPS,
    )
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        sizes = {"all": (count, width, height), "none": (1, 8, 8)}
        found = {}
        for name, size in sizes.items():
            write_scene(folder / name, *size)
            found[name] = _measure(job, folder / name)
    photos, held = count * width * height * 3, found["none"]["VmRSS"]
    note = f"{count} photos of {width}x{height}: {photos / 1e9:.3g} GB"
    peak = found["all"]["VmHWM"]
    for what, unit, value in (
        ("peak of the whole process", "x photos", peak / photos),
        ("held without photos", "GB", held / 1e9),
        ("peak, net of that", "x photos", (peak - held) / photos),
    ):
        yield {"what": what, "unit": unit, "ours": [value], "note": note}


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


def _measure(job, folder):
    """Bytes resident, {"VmHWM": at most, "VmRSS": at the end}, of a training."""
    request = [cases.as_json(job), str(folder)]
    return measure.elsewhere("tools.bench.memory", request)


def _train(job, folder):
    """Train here, and print what is resident, and was at most."""
    out = pathlib.Path(folder, "out")
    options = {
        "config": job,
        "scene": folder,
        "checkpoints": out / "checkpoints",
        "learnt": out / "learnt",
        "timing": out / "timing.json",
    }
    train.main([str(part) for k, v in options.items() for part in (f"--{k}", v)])
    # Not getrusage, which may report the peak of the process that started this one.
    lines = pathlib.Path("/proc/self/status").read_text().splitlines()
    status = dict(line.split(":", 1) for line in lines)
    found = {key: 1024 * int(status[key].split()[0]) for key in ("VmHWM", "VmRSS")}
    print(json.dumps(found))


if __name__ == "__main__":
    _train(*json.loads(sys.argv[1]))
