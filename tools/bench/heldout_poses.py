"""`make poses` on captures that it was not developed with, one planted mistake each.

    python -m tools.bench.heldout_poses CAPTURES WORK --out FILE

CAPTURES holds raw captures as `raw_captures` reads them. Each is written as a user's
folder into WORK, once for each of `camera_plants.CASES`, and `make poses` is run on it
there. A row says how far the cameras of the file are from the true ones, in px of the
photo as written, how far those are that come out, and which faults were named. Rows
that the CSV has are not run again. All are of one state of the rules, whose digest is
`rules`: a CSV of another state is refused.
"""

import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from alignerf.captures import base, typed
from alignerf.cli import folders, poses
from alignerf.exports import formats
from alignerf.io import atomic, images, provenance
from alignerf.scenes import cameras, distortion, prepare
from alignerf.sfm import bundle, calibration, matches, mistakes, pose_error
from tools.bench import camera_plants, measure, raw_captures

HELD_OUT = ("fountain-P11", "Herz-Jesus-P8", "Herz-Jesus-P25", "entry-P10")
HELD_OUT += ("templeRing", "dtu_scan65")
# Fewer points of a view say nothing of its camera.
MIN_POINTS = 8
# What a refusal says -> the kind of fault that it names.
REFUSALS = {
    "its cameras have": "convention",
    "is not a rotation": "convention",
    "principal point": "principal_point",
    "do not fit these photos": "unrelated",
}
# Cameras that nobody complains of are right where they are off by no more.
RIGHT_PX = 1.0
# Its folder is a model of COLMAP's, where such quaternions stand.
AS_COLMAP = "quaternions_xyzw"


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("captures_folder", type=Path, metavar="CAPTURES")
    parser.add_argument("work", type=Path)
    parser.add_argument("--captures", nargs="+", default=HELD_OUT)
    parser.add_argument("--cases", nargs="+", default=[*camera_plants.CASES])
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(argv)
    rules, every = digest(), raw_captures.places(args.captures_folder)
    if missing := [name for name in args.captures if name not in every]:
        raise SystemExit(f"{args.captures_folder}: no {', '.join(missing)}")
    rows = rows_of(args.out, rules)
    done = {(row["capture"], row["case"]) for row in rows}
    for name in args.captures:
        todo = [case for case in args.cases if (name, case) not in done]
        if not todo:
            continue
        capture = raw_captures.read(every[name])
        points = points_of(capture, args.work / "points" / f"{name}.npz")
        for case in todo:
            row = row_of(name, case, capture, points, args.work)
            rows.append(row | {"rules": rules})
            write(args.out, rows)
            print(row, flush=True)
    right = sum(row["right"] == "yes" for row in rows)
    print(f"{right} of {len(rows)} right")


def digest():
    """`measure.digest` of what `make poses` judges cameras by."""
    return measure.digest("alignerf/sfm", "alignerf/keypoints")


def rows_of(path, rules):
    """The rows of a CSV that is there; ValueError where they are of other rules."""
    if not path.is_file():
        return []
    types = {"rules": str}
    table = pd.read_csv(path, comment="#", keep_default_na=False, dtype=types)
    if others := sorted({*table["rules"]} - {rules}):
        raise ValueError(
            f"{path}: its rows are of the rules {', '.join(others)}, not {rules}: "
            "move it away to measure all of them"
        )
    return table.to_dict("records")


def write(path, rows):
    """Write the CSV below the lines that say where it comes from."""
    table = pd.DataFrame(rows)
    command = "python -m tools.bench.heldout_poses CAPTURES WORK --captures "
    command += " ".join([*table["capture"].unique(), "--out FILE"])
    head = measure.head(command, f"{os.cpu_count()} cores of a shared machine")
    with atomic.replace_file(path) as temporary:
        temporary.write_text(head + table.to_csv(index=False))


def points_of(capture, path):
    """{view: [k, 3]} points of the world that the true cameras triangulate; kept."""
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent) as work:
            width, height = capture.size
            views = prepare.PosedViews(
                *(capture.names, capture.true.pixtocams, capture.true.camtoworlds),
                *(width, height),
                photos=list(map(prepare.Photo, capture.photos)),
            )
            found = matches.find(views, work, max_size_px=width, seed=0)
            points, _ = bundle.triangulate(found, capture.true, work, seed=0)
        each = {str(v): points.of_view(v) for v in range(len(capture.names))}
        np.savez(path, **each)
    with np.load(path) as arrays:
        return {int(view): arrays[view] for view in arrays.files}


def row_of(name, case, capture, points, work):
    """Plant a mistake in a capture, run `make poses` on it, and say what came of it."""
    plant, kinds = camera_plants.CASES[case]
    planted = plant(capture)
    run_name = f"{name}_{case}".replace(".", "_")
    folder, out = work / "scans" / run_name, work / "results" / run_name
    for old in (folder, out):
        shutil.rmtree(old, ignore_errors=True)
    (work / "results" / f"{run_name}.yaml").unlink(missing_ok=True)
    write_scan(folder, planted, colmap=case == AS_COLMAP)
    code, line, wall_s, cpu_s = run(folder.relative_to(work), run_name, work)
    report, now = outcome(folder, out / "adjusted", planted)
    named = [fault["kind"] for fault in report.get("faults", [])]
    named += [kind for words, kind in REFUSALS.items() if code and words in line][:1]
    seen = in_photo(planted, points)
    before, after = (off_px(one, planted.true, seen) for one in (planted.given, now))
    is_right = (named or [""])[0] in kinds and (named or np.median(after) < RIGHT_PX)
    return {
        "capture": name,
        "width": planted.size[0],
        "views": len(planted.names),
        "case": case,
        "epipolar_px": report.get("epipolar_px"),
        "planted_px": round(float(np.median(before)), 3),
        "planted_worst_px": round(float(np.max(before)), 3),
        "left_px": round(float(np.median(after)), 3),
        "left_worst_px": round(float(np.max(after)), 3),
        "named": " ".join(named),
        "right": "yes" if is_right else "no",
        "line": line,
        "code": code,
        "wall_s": round(wall_s, 1),
        "cpu_s": round(cpu_s, 1),
    }


def write_scan(folder, capture, *, colmap=False):
    """Write photos and cameras as a user has them; the cameras are those given."""
    for name, photo in zip(capture.names, capture.photos, strict=True):
        images.write(folder / "images" / f"{name}.png", photo)
    if colmap:
        write_model(folder / "sparse" / "0", capture)
        return
    width, height = capture.size
    arrays = {
        "names": np.array(capture.names),
        "split": np.array(["train"] * len(capture.names)),
        "pixtocams": capture.given.pixtocams,
        "camtoworlds": capture.given.camtoworlds,
        "width": width,
        "height": height,
    }
    formats.write_transforms(folder / "transforms.json", arrays)


def write_model(folder, capture):
    """Write COLMAP's text files of one camera and no points."""
    folder.mkdir(parents=True)
    lens = capture.given.camtopix[0][[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
    text = " ".join(map(repr, [*capture.size, *lens]))
    (folder / "cameras.txt").write_text(f"1 PINHOLE {text}\n")
    inverse = mistakes.inverted(mistakes.turned(capture.given.camtoworlds))
    lines = []
    for i, (name, pose) in enumerate(zip(capture.names, inverse, strict=True), 1):
        turn = Rotation.from_matrix(pose[:, :3]).as_quat(scalar_first=True)
        numbers = " ".join(map(repr, [*turn.tolist(), *pose[:, 3].tolist()]))
        lines.append(f"{i} {numbers} 1 {name}.png\n\n")
    (folder / "images.txt").write_text("".join(lines))
    (folder / "points3D.txt").write_text("")


def run(folder, name, work):
    """(exit code, the line that it prints, wall and CPU seconds) of `make poses`."""
    command = [sys.executable, "-m", "alignerf", "poses", str(folder), "--name", name]
    environment = os.environ | {"PYTHONPATH": str(provenance.ROOT)}
    started, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        command, cwd=work, env=environment, capture_output=True, text=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = sum(after[:2]) - sum(before[:2])
    if done.returncode:
        said = done.stderr.strip().splitlines()[-1:]
    else:
        lines = done.stdout.splitlines()
        said = [one.removeprefix(f"{name}: ") for one in lines if "results/" not in one]
    # What a CSV of the docs has none of.
    line = re.sub(r"[*|#]", "", "; ".join(said)).replace("`", "'")
    return done.returncode, line, time.monotonic() - started, cpu_s


def as_read(folder, capture):
    """The cameras that the program reads in a user's folder."""
    ((_, scene),) = folders.scenes_of(typed.meant(folder, "poses")).items()
    config = poses.config_of(scene, poses.parse([str(folder)]), folder)
    with tempfile.TemporaryDirectory() as work:
        views, *_ = base.of(config).read(config, Path(work))
    order = [views.names.index(name) for name in capture.names]
    lenses = np.linalg.inv(views.pixtocams[order])
    return capture.given._replace(camtopix=lenses, camtoworlds=views.camtoworlds[order])


def outcome(scan, folder, capture):
    """(the report, {} without one; the cameras that came out, in px of the photos).

    scan: the user's folder; folder: what came of it.
    """
    if not (folder / "report.json").is_file():
        return {}, capture.given
    report = json.loads((folder / "report.json").read_text())
    if not (folder / "transforms.json").is_file():
        return report, as_read(scan, capture)
    scene = json.loads((folder / "transforms.json").read_text())
    frames = {Path(frame["file_path"]).stem: frame for frame in scene["frames"]}
    ordered = [frames[name] for name in capture.names]
    camtopix = np.array(
        [[[f["fl_x"], 0, f["cx"]], [0, f["fl_y"], f["cy"]], [0, 0, 1]] for f in ordered]
    )
    camtoworlds = np.array([frame["transform_matrix"] for frame in ordered])[:, :3]
    bends = np.zeros((len(ordered), 5))
    if coefficients := report["adjustment"].get("distortion"):
        bends[:] = coefficients
        camtopix = np.stack([lens_of(one, bends[0], capture.size) for one in camtopix])
    return report, calibration.Cameras(camtopix, camtoworlds, bends)


def lens_of(pinhole, coefficients, size):
    """The intrinsics whose photo is this pinhole's where its distortion is undone."""
    found = pinhole.copy()
    for _ in range(6):
        found += pinhole - distortion.pinhole_camera(found, coefficients, *size)
    return found


def in_photo(capture, points):
    """{view: the points [k, 3] that its photo shows}, of views that show enough."""
    found = {}
    for view, xyz in points.items():
        xy = pixels(capture.true, view, xyz)
        shown = xyz[((xy > 0) & (xy < capture.size)).all(axis=1)]
        if len(shown) >= MIN_POINTS:
            found[view] = shown
    return found


def off_px(now, true, points):
    """[n] of each view, how far apart its two cameras put its points: the median.

    As `pose_error.distance_px`, at most its FAR_PX, of lenses with a distortion too.
    """
    scale, turn, shift = pose_error.fit(now, true, points)
    found = []
    for view, xyz in points.items():
        moved = scale * xyz @ turn.T + shift
        off = pixels(now, view, moved) - pixels(true, view, xyz)
        px = np.linalg.norm(off, axis=-1)
        found.append(np.median(np.where(px < pose_error.FAR_PX, px, pose_error.FAR_PX)))
    return np.array(found)


def pixels(of, view, points):
    """Px [k, 2] at which a view's camera sees points [k, 3]."""
    own, lens = of.camtoworlds[view], of.camtopix[view]
    seen = (points - own[:, 3]) @ own[:, :3] @ cameras.OPENGL_FROM_OPENCV
    return distortion.distort_points(
        seen[:, :2] / seen[:, 2:], lens, of.distortion[view]
    )


if __name__ == "__main__":
    main()
