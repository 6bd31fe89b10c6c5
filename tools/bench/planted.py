"""Is the verdict right? Captures with known faults, made, trained and flowed.

    python -m tools.bench.planted --out results/planted results/fox results/castle ...

Each capture is a prepared scene, whose images are its photos. Every fault of
`tools.bench.faults` is put in, in three strengths and with another. The capture
is trained at a smaller size, rendered, and its flows are split. What is there is
not made again. `tools.bench.limits` judges the cases.
"""

import argparse
import concurrent.futures
import dataclasses
import json
import multiprocessing
import shutil
import zlib
from pathlib import Path

import numpy as np

from alignerf.io import atomic, images
from alignerf.scenes import prepare, prepared
from tools.bench import faults

STEPS, PIXELS = 1500, 30_000
MODEL = {
    "proposal": {"levels": 3, "max_resolution": 128},
    "field": {"log2_hashmap_size": 15, "max_resolution": 1024},
}
DONE = "case.json"


@dataclasses.dataclass(frozen=True)
class Case:
    """Faults (name, which strength) in a capture: a prepared scene's folder."""

    capture: Path
    plants: tuple
    seed: int = 0

    @property
    def name(self):
        parts = [f"{name.replace(' ', '_')}{place}" for name, place in self.plants]
        return "+".join(parts) + f"_seed{self.seed}" * (self.seed > 0)

    def folder(self, out):
        return Path(out) / self.capture.name / self.name

    def of(self, when):
        """[(what puts it in, strength)] of the faults that are put in then."""
        found = []
        for name, place in self.plants:
            plant = faults.PLANTS[name]
            if change := getattr(plant, when):
                found.append((change, plant.strengths[place]))
        return found

    def rng(self):
        return np.random.default_rng([self.seed, zlib.crc32(self.name.encode())])


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("captures", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--faults", nargs="+", choices=[*faults.PLANTS], metavar="NAME")
    parser.add_argument("--strengths", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args(argv)
    todo = [
        case
        for case in cases(args.captures, args.faults, args.strengths)
        if not (case.folder(args.out) / DONE).is_file()
    ]
    # A process of its own for each capture's cases in turn: compiled programs are kept.
    spawn = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(args.jobs, mp_context=spawn) as pool:
        work = {pool.submit(make, case, args.out): case for case in todo}
        for number, one in enumerate(concurrent.futures.as_completed(work), 1):
            case, error = work[one], one.exception()
            print(f"{number} of {len(todo)}", case.capture.name, case.name, error or "")


def cases(captures, names=None, places=(0, 1, 2)):
    """Cases of the faults named, or of all; those first that others need, then the
    middle strengths.
    """
    found = [((("nothing", 0),), seed) for seed in ((0,) if names else (0, 1))]
    for place in (1, 2, 0):
        found += [
            (((name, min(place, len(plant.strengths) - 1)),), 0)
            for name, plant in faults.PLANTS.items()
            if place in places
            and name in (names or faults.PLANTS)
            and name != "nothing"
        ]
        if place == 1 and not names:
            found += [(tuple((name, 1) for name in pair), 0) for pair in faults.PAIRS]
    found = dict.fromkeys(found)
    return [
        Case(Path(capture), plants, seed)
        for plants, seed in found
        for capture in captures
    ]


def make(case: Case, out):
    """Make a case's scene, training, renders and flows."""
    folder = case.folder(out)
    if folder.is_dir():
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    rng, capture = case.rng(), load(case.capture, out)
    for change, strength in case.of("before"):
        capture = change(capture, strength, rng)
    told = {"refused": None}
    try:
        write_scene(folder, case, capture, out)
    except ValueError as error:
        told["refused"] = str(error)
    else:
        render(folder, case, capture.fraction, out)
        if after := case.of("after"):
            spoil(folder, after, rng)
        flows(folder)
    with atomic.replace_file(folder / DONE) as path:
        path.write_text(json.dumps(told))


def load(scene, out) -> faults.Capture:
    """A prepared scene as a capture; its points are triangulated once."""
    loaded = prepared.read_cameras(scene / "cameras.npz")
    photos = [images.read(scene / "images" / f"{name}.png") for name in loaded["names"]]
    points = np.load(matched(scene, out) / "points.npy")
    return faults.Capture(
        names=loaded["names"].tolist(),
        split=loaded["split"],
        photos=np.array(photos),
        pixtocams=loaded["pixtocams"],
        camtoworlds=loaded["camtoworlds"],
        points=points,
    )


def matched(scene, out):
    """The folder of a capture's matches and points, made where it is not there."""
    from alignerf.sfm import checking, matches

    folder = Path(out) / scene.name / "matched"
    if (folder / "points.npy").is_file():
        return folder
    arrays = prepared.read_cameras(scene / "cameras.npz")
    names = arrays["names"].tolist()
    views = views_of(
        names,
        np.array([images.read(scene / "images" / f"{name}.png") for name in names]),
        *(arrays["pixtocams"], arrays["camtoworlds"]),
    )
    with atomic.scratch_folder(folder.parent) as scratch:
        checked = checking.check(
            views, scratch, config_of(scene), adjusts=False, lens=False
        )
        points, _ = checking.triangulated(checked, scratch, 0)
        folder.mkdir(parents=True, exist_ok=True)
        matches.write(folder / "matches.npz", checked.matches)
        with (
            atomic.replace_file(folder / "points.npy") as path,
            open(path, "wb") as file,
        ):
            np.save(file, points.positions)
    return folder


def views_of(names, photos, pixtocams, camtoworlds):
    height, width = photos.shape[1:3]
    return prepare.PosedViews(
        *(names, pixtocams, camtoworlds, width, height),
        photos=list(map(prepare.Photo, photos)),
    )


def config_of(scene):
    from alignerf.experiment.checks import scenes as of_scenes

    keys = {"source": "transforms", "path": str(scene), "adjust_again": False}
    return of_scenes.checked(keys)


def write_scene(folder, case, capture, out):
    """The prepared scene, its poses.json with what matches say of the cameras."""
    from alignerf.sfm import checking, matches

    views = views_of(
        capture.names, capture.photos, capture.pixtocams, capture.camtoworlds
    )
    known = None
    same = {"poses", "focal", "principal point", "order", "short", "nothing"}
    if all(name in same or faults.PLANTS[name].after for name, _ in case.plants):
        known = matches.load(matched(case.capture, out) / "matches.npz")
    with atomic.scratch_folder(folder) as scratch:
        checked = checking.check(
            *(views, scratch, config_of(folder)),
            adjusts=True,
            lens=False,
            matched=known,
        )
        told = {"camera_check": checked.report}
        points, _ = checking.triangulated(checked, scratch, 0)
        if len(points.positions):
            told |= checking.points_told(points, views, checked.matches)
    count, (width, height) = len(capture.names), capture.size
    small = prepare.downscale(views, max(1.0, (width * height / PIXELS) ** 0.5))
    prepare.write_views(folder, small, split=capture.split)
    matches.write(folder / matches.FILE, checked.matches)
    told |= {"registered": count, "total": count, "poses": "input", "perturb_px": 0.0}
    told |= {"width": small.width, "height": small.height, "photo_width": width}
    told |= {"photo_height": height, "photos_alone": None}
    told.setdefault("mean_reprojection_error_px", None)
    (folder / "poses.json").write_text(json.dumps(told))


def render(folder, case, fraction, out):
    """Train and render; where only renders are spoilt, those of nothing are taken."""
    from alignerf import render_views, train

    base = folder / "round0"
    before = [name for name, _ in case.plants if faults.PLANTS[name].before]
    own = Case(case.capture, (("nothing", 0),), case.seed).folder(out) / "round0"
    if not before and own != base and (own / "depth").is_dir():
        base.mkdir()
        shutil.copytree(own / "renders", base / "renders")
        shutil.copytree(own / "depth", base / "depth")
        shutil.copyfile(own / "timing.json", base / "timing.json")
        return
    steps = max(round(STEPS * fraction), 20)
    job = {"seed": case.seed, "stage": "full", "model": MODEL, "alignerf": None}
    job["training"] = {"steps": steps}
    shared = ["--config", json.dumps(job), "--scene", str(folder), "--threads", "1"]
    base.mkdir()
    train.main(
        [
            *shared,
            *("--checkpoints", str(base / "checkpoints")),
            *("--learnt", str(base / "learnt"), "--timing", str(base / "timing.json")),
        ]
    )
    render_views.main(
        [
            *(*shared, "--model", str(base / "learnt" / "model.msgpack")),
            *("--splits", "train", "test", "--renders", str(base / "renders")),
            *("--depth", str(base / "depth"), "--timing", str(base / "render")),
        ]
    )
    shutil.rmtree(base / "checkpoints", ignore_errors=True)


def spoil(folder, after, rng):
    """Put faults into renders and their depth."""
    loaded, base = prepared.load(folder), folder / "round0"
    paths = [
        base / "renders" / split / f"{name}.png"
        for name, split in zip(loaded.names, loaded.split, strict=True)
    ]
    depths = [base / "depth" / path.parent.name / f"{path.stem}.npz" for path in paths]
    renders = np.array(list(map(images.read, paths)))
    stored = [dict(np.load(path)) for path in depths]
    depth = np.array([one["depth"] for one in stored])
    for change, strength in after:
        renders, depth = change(renders, depth, strength, rng)
    for path, image in zip(paths, renders, strict=True):
        images.write(path, image)
    for path, own, values in zip(depths, stored, depth, strict=True):
        np.savez(path, **own | {"depth": values})


def flows(folder):
    """Flows, their parts, and the flow that the estimator invents."""
    from flow import align, control_sets, decompose

    base, photos = folder / "round0", str(folder / "images")
    fault = align.run(
        [
            *("--match-blur", "--blur-by", "dis_fast"),
            *("--splits", "train", "test", "--renders", str(base / "renders")),
            *("--photos", photos, "--depth", str(base / "depth")),
            *("--flow-out", str(base / "flow")),
            *("--stats-out", str(base / "displacement")),
        ]
    )
    for split in prepared.SPLITS:
        fault |= decompose.run(
            [
                *("--renders-depth", str(base / "depth" / split)),
                *("--flow", str(base / "flow" / split), "--split", split),
                *("--cameras", str(folder / "cameras.npz")),
                *("--out-flow", str(base / "parts_photos" / split)),
                *("--stats-out", str(base / f"decomposition_photos_{split}.csv")),
            ]
        )
    fault |= control_sets.run(
        [
            *("--renders", str(base / "renders" / "train"), "--photos", photos),
            *("--flow", str(base / "flow" / "train")),
            *("--lengths", str(base / "overfit.csv")),
        ]
    )
    if fault:
        raise ValueError(f"{folder}: a stage of flows failed")


if __name__ == "__main__":
    main()
