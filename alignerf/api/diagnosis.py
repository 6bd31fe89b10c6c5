"""Renders that another program has trained, judged from Python: `alignerf.diagnose`.

It runs `why-blurry judge` in a folder that is removed afterwards, in a process of its
own: nothing of the program that calls it changes.

Notation: n views; cameras have OpenCV's axes (x right, y down, z forwards), pixel
centers at +0.5, and the caller's unit of length.
"""

import dataclasses
import json
import math
import numbers
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence, Set
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from alignerf.experiment import layout
from alignerf.io import (
    atomic,
    csv_files,
    faults,
    images,
    json_files,
    machine,
    provenance,
)
from alignerf.judged import views
from alignerf.verdict import kinds

# From OpenCV's axes to OpenGL's, and back.
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
NAME, MODES = "diagnosed", ("camera_to_world", "world_to_camera")
# Causes that corrected cameras fix; one that they fix where matches have found it;
# levels of causes that are named.
POSES, LENS, NAMED = ("camera", "focal"), ("lens_shift",), ("faulty", "likely")
# What exports from the folder that is no more.
EXPORT = f"make export SCENE={NAME}"
# And what of a text points at it: "the command below", lines, items of the page.
BELOW = r"the\s+command\s+below"
LINE = re.compile(rf"^ *(For other programs: )?{EXPORT}\n?", re.MULTILINE)
ITEMS = "<li><label>Train on them.*?</li>|<li>For other programs.*?</li>"
BLOCK = f'<div class="command"><code>{EXPORT}</code>.*?</div>'
PARTS = re.compile(f"{ITEMS}|{BLOCK}", re.DOTALL)
LINK = re.compile(r'<a (?:data-doc href="[^"]*"|href="[\w/.]+")>(.*?)</a>', re.DOTALL)

Images = np.ndarray | Iterable[np.ndarray]
Files = str | os.PathLike


@dataclasses.dataclass(frozen=True)
class Cause:
    """Something that can be wrong. level: `faulty` or `likely` where it is, `ok`, or
    `cannot tell` by these renders. value: NaN where unknown."""

    name: str
    level: str
    value: float
    unit: str
    sentence: str


@dataclasses.dataclass(frozen=True)
class Report:
    """What was found.

    verdict: text. state: `aligned`, `misaligned` or `unclear`. causes: all that were
    looked for. views: a row a view. cameras: {"names": [n], "K" [n, 3, 3],
    "camera_to_world" [n, 4, 4]}: corrected where wrong poses were found, as `corrected`
    says, else those given; None without any. page: HTML.
    """

    verdict: str
    state: str
    causes: list[Cause]
    views: pd.DataFrame
    cameras: dict | None
    corrected: bool
    page: str

    def save(self, path: Files) -> None:
        """Write the page: verdict, photos and renders under a slider, in one file."""
        Path(path).write_text(LINK.sub(r"\1", self.page), encoding="utf-8")

    def __str__(self) -> str:
        return self.verdict


def diagnose(
    images: Images | Files,
    renders: Images | Files,
    cameras: Mapping | Files | None = None,
    *,
    depth: Images | Files | None = None,
    held_out: Sequence[int] = (),
    cores: int | None = None,
) -> Report:
    """What is wrong with the capture whose photos these renders were learned from.

    images (the photos), renders: [n, h, w, 3] uint8, or whatever yields [h, w, 3], in
    one order; or folders, as `why-blurry judge` takes them. cameras: with arrays a
    mapping of "K" ([3, 3] or [n, 3, 3]) and either "camera_to_world" or
    "world_to_camera" ([n, 3 or 4, 4], OpenCV's axes); with folders transforms.json,
    COLMAP's sparse/0 or cameras.json.
    depth: [n, h, w] along the optical axis, in the cameras' unit, or a folder.
    held_out: indices of arrays' views that the model has not learned from.
    Raises ValueError, in one line, for input that cannot be judged.
    """
    given: dict[str, Any] = {"photos": images, "renders": renders}
    given |= {"cameras": cameras, "depth": depth}
    if cores is not None and (not is_whole(cores) or cores < 1):
        raise ValueError("cores: a whole number from 1 on was expected")
    if not isinstance(images, Files):
        for key, name in (("photos", "images"), ("renders", "renders")):
            given[key] = listed(given[key], name)
        if depth is not None:
            given["depth"] = listed(depth, "depth")
        held_out = indices(held_out)
    with atomic.scratch_folder(tempfile.gettempdir(), name="why-blurry") as work:
        if isinstance(images, Files):
            paths = of_files(given, held_out)
        else:
            paths = of_arrays(work, given, held_out)
        words = [f"--{key}={path}" for key, path in paths.items()]
        run(work, "judge", *words, "--name", NAME, cores=cores)
        return report_of(work, paths, cores)


def of_files(given: Mapping[str, Any], held_out: Sequence[int]) -> dict[str, Path]:
    """{name: whole path}."""
    if np.size(held_out):
        raise ValueError("held_out: of arrays; folders say it (renders/train, /test)")
    for name, path in given.items():
        if path is not None and not isinstance(path, Files):
            raise ValueError(f"{name}: a path was expected, as images is one")
    return {
        key: faults.resolved(os.path.expanduser(os.fsdecode(path)))
        for key, path in given.items()
        if path is not None
    }


def listed(values: Any, name: str) -> list:
    """The arrays that something yields in order, at least one; ValueError else."""
    if isinstance(values, Files):
        raise ValueError(f"{name}: arrays were expected, as images are")
    try:
        views = iter(values)
    except TypeError:
        views = None
    if views is None or isinstance(values, bytes | Mapping | Set):
        raise ValueError(f"{name}: arrays or folders were expected")
    # What fails while they are made is the caller's.
    if not (found := list(views)):
        raise ValueError(f"{name}: none were given")
    return found


def is_whole(value: object) -> bool:
    """Whether it is a whole number; truth values would be taken for 0 and 1."""
    return isinstance(value, numbers.Integral) and not isinstance(value, bool)


def indices(values: Any) -> list[int]:
    """A list of whole numbers."""
    try:
        found: list[Any] = list(values)
    except TypeError:
        found = [None]
    if not all(map(is_whole, found)):
        raise ValueError("held_out: indices of views were expected")
    return found


def array(values: object) -> np.ndarray:
    """An array of real numbers; of anything else, an empty one of objects.

    Other numbers would lose their imaginary part on the way into a file.
    """
    try:
        found = np.asarray(values)
    # Whatever an object of another library raises.
    except Exception:
        found = np.zeros(0, object)
    return found if found.dtype.kind in "biuf" else np.zeros(0, object)


def floats(values: object, name: str) -> np.ndarray:
    """A float array of finite numbers; ValueError with its name."""
    found = array(values)
    if found.dtype == object or not np.isfinite(found).all():
        raise ValueError(f"{name}: an array of finite numbers was expected")
    return found.astype(float)


def of_arrays(
    work: Path, given: Mapping[str, Any], held_out: Sequence[int]
) -> dict[str, Path]:
    """The paths of arrays, which are written into a folder."""
    taken, rendered, maps = given["photos"], given["renders"], given["depth"]
    cameras, names = given["cameras"], [f"view{i:04d}" for i in range(len(taken))]
    for key, arrays in (("renders", rendered), ("depth", maps)):
        if arrays is not None and len(arrays) != len(names):
            raise ValueError(f"{key}: {len(arrays)} of {len(names)} images")
    if strange := set(held_out) - set(range(len(names))):
        raise ValueError(f"held_out: there is no view {min(strange)}")
    paths = {"photos": work / "photos", "renders": work / "renders"}
    for i, name in enumerate(names):
        split = "test" if i in held_out else "train"
        write(paths["photos"] / f"{name}.png", taken[i], f"images[{i}]")
        write(paths["renders"] / split / f"{name}.png", rendered[i], f"renders[{i}]")
    if maps is not None:
        paths["depth"] = work / "depth"
        paths["depth"].mkdir()
        for name, one in zip(names, maps, strict=True):
            np.save(paths["depth"] / f"{name}.npy", depth_of(one, f"depth of {name}"))
    if cameras is not None:
        paths["cameras"] = work / "transforms.json"
        sizes = [np.shape(photo)[1::-1] for photo in taken]
        written = transforms_of(cameras, names, sizes)
        paths["cameras"].write_text(json.dumps(written))
    return paths


def depth_of(values: object, where: str) -> np.ndarray:
    """[h, w] float32, infinite where far; ValueError with its name."""
    found = array(values)
    if found.ndim != 2 or not found.size:
        raise ValueError(f"{where}: numbers [h, w] were expected")
    # What float32 does not hold is far away.
    with np.errstate(over="ignore"):
        return found.astype(np.float32)


def write(path: Path, image: object, where: str) -> None:
    """Write a PNG; ValueError, naming the array, for what is no image."""
    found = array(image)
    shape = found.shape
    if found.dtype != np.uint8 or len(shape) != 3 or shape[2] != 3 or not found.size:
        kind = f"{found.dtype} {list(shape)}"
        raise ValueError(f"{where}: {kind} instead of uint8 [h, w, 3]")
    path.parent.mkdir(parents=True, exist_ok=True)
    images.write(path, found)


def transforms_of(
    cameras: object, names: Sequence[str], sizes: Sequence[tuple[int, int]]
) -> dict[str, list]:
    """The content of a transforms.json; ValueError naming what a mapping lacks."""
    if not isinstance(cameras, Mapping):
        raise ValueError("cameras: a mapping was expected, as images are arrays")
    modes = [mode for mode in MODES if mode in cameras]
    if "K" not in cameras or len(modes) != 1 or len(cameras) != 2:
        raise ValueError(f"cameras: K and either {' or '.join(MODES)} were expected")
    n, poses = len(names), floats(cameras[modes[0]], f"cameras.{modes[0]}")
    if poses.shape not in ((n, 3, 4), (n, 4, 4)):
        kind = list(poses.shape)
        raise ValueError(f"cameras.{modes[0]}: {kind} instead of [{n}, 3 or 4, 4]")
    camtopix = floats(cameras["K"], "cameras.K")
    if camtopix.shape not in ((3, 3), (n, 3, 3)):
        kind = list(camtopix.shape)
        raise ValueError(f"cameras.K: {kind} instead of [3, 3] or [{n}, 3, 3]")
    camtopix = np.broadcast_to(camtopix, (n, 3, 3))
    rest = camtopix * [[0, 1, 0], [1, 0, 0], [1, 1, 0]]
    if rest.any() or (camtopix[:, [0, 1], [0, 1]] <= 0).any():
        raise ValueError("cameras.K: focal lengths above 0 and no skew were expected")
    whole = np.tile(np.eye(4), (n, 1, 1))
    whole[:, :3] = poses[:, :3]
    if modes[0] == "world_to_camera":
        if (np.abs(np.linalg.det(whole)) < 1e-9).any():
            raise ValueError("cameras.world_to_camera: no rotation in it")
        whole = np.linalg.inv(whole)
    frames = []
    for name, k, pose, (width, height) in zip(
        names, camtopix, whole @ FLIP, sizes, strict=True
    ):
        frame = {"file_path": f"photos/{name}.png", "w": width, "h": height}
        frame |= {"fl_x": k[0, 0], "fl_y": k[1, 1], "cx": k[0, 2], "cy": k[1, 2]}
        frames.append(frame | {"transform_matrix": pose.tolist()})
    return {"frames": frames}


def run(work: Path, command: str, *words: str, cores: int | None) -> None:
    """Run a command of ours in a folder; its fault as ValueError."""
    path = [str(provenance.ROOT), os.environ.get("PYTHONPATH", "")]
    module = [sys.executable, "-m", f"alignerf.cli.{command}"]
    done = subprocess.run(
        [*module, "--cores", str(cores or machine.cores()), *words],
        cwd=work,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, path))},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
    )
    if done.returncode:
        said = (done.stderr + done.stdout).splitlines()
        found = [line for line in said if line.startswith("error: ")]
        last = (found or said or [f"ended with {done.returncode}"])[-1]
        raise ValueError(last.removeprefix("error: ").replace(f"{work}{os.sep}", ""))


def report_of(work: Path, paths: Mapping[str, Path], cores: int | None) -> Report:
    """The `Report` of results in a folder."""
    at = work / layout.Scene(NAME)
    keys = kinds.VERDICT | {"findings": [{"cause": str}]}
    found = json_files.read(at / "verdict.json", keys)
    named = [finding["cause"] for finding in found["findings"]]
    sentences = dict(zip(named, found["because"], strict=False))
    causes = [
        Cause(
            one["cause"],
            one["level"],
            math.nan if one["value"] is None else one["value"],
            one["unit"],
            sentences.get(one["cause"], f"{one['text']}."),
        )
        for one in found["causes"]
    ]
    accepted = (found["evidence"].get("matches") or {}).get("accepted")
    fixed = (*POSES, *LENS) if accepted else POSES
    wrong = any(one.name in fixed and one.level in NAMED for one in causes)
    corrected = wrong and "cameras" in paths
    cameras = None
    if corrected:
        run(work, "export", NAME, cores=cores)
        (exported,) = at.glob("*/export/cameras/transforms.json")
        cameras = cameras_of(exported, paths["photos"])
    elif "cameras" in paths:
        cameras = cameras_of(paths["cameras"], paths["photos"])
    return Report(
        told("\n".join(found["verdict"]), corrected=corrected),
        found["state"],
        causes,
        csv_files.read(work / layout.Scene(NAME).views),
        cameras,
        corrected,
        told(faults.text(at / "index.html"), corrected=corrected),
    )


def told(text: str, *, corrected: bool = False) -> str:
    """A text of a judgement for one who has its `Report`, and not its folder."""
    text = PARTS.sub("", LINE.sub("", text))
    if corrected:
        them = rf"{BELOW}\s+writes\s+them|an\s+export\s+corrects\s+them"
        text = re.sub(them, "they are in report.cameras", text)
    text = text.replace("DEPTH=folder", "depth=")
    return re.sub(BELOW, "an export of `why-blurry judge`", text)


def cameras_of(path: Path, folder: Path) -> dict[str, Any]:
    """The cameras of a file or folder that photos of a folder have, by their names."""
    found = sorted(views.taken(folder, path).shots, key=lambda shot: shot.name)
    poses = np.tile(np.eye(4), (len(found), 1, 1))
    poses[:, :3] = [shot.pose for shot in found]
    camtopix = np.stack([shot.at(shot.head.size, shot.name)[0] for shot in found])
    names = [shot.name for shot in found]
    return {"names": names, "K": camtopix, "camera_to_world": poses @ FLIP}
