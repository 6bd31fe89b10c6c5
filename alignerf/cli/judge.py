"""Diagnose a model of another program: `make judge PHOTOS=... RENDERS=... CAMERAS=...`.

PHOTOS: folder of the photos. RENDERS: folder of the program's renders at the same
cameras, of training and held-out photos; or SPLAT: the .ply of Gaussians, which is
rendered here. CAMERAS: transforms.json, cameras.json or COLMAP's sparse/0, or the
folder of one. DEPTH: folder of the renders' depth along the optical axis, <photo>.npy,
in the unit of the cameras. Nothing is trained. The config, results/NAME.yaml, is yours
to edit. Renders or photos that have changed get new results, which are compared with
the last ones of the same photos.
"""

import argparse
import contextlib
import itertools
import logging
import os
import re
import sys
from pathlib import Path

from alignerf.captures import typed
from alignerf.cli import configs, folders, light, workflow
from alignerf.experiment import layout, targets
from alignerf.experiment.checks import results
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.io import atomic, faults, owned, provenance
from alignerf.judged import camera_files, originals, splat, views
from alignerf.scenes import prepared
from alignerf.verdict import evidence

log = logging.getLogger("alignerf")

# The name of the method that the renders are of.
THEIRS = "theirs"
# Above so many pixels in all pairs the usual estimator takes too long: of 100 pairs of
# 1600x1200 px it takes half an hour, and `dis_fine` a quarter of that. That one finds
# 0.3 px, and motion, between photos and sharp renders of right poses, where the usual
# one finds 0.14 px.
MAX_PIXELS, LARGE = 100_000_000, "dis_fine"
SPLATS = Path(layout.SPLATS)
ASSUMED = (
    "CAMERAS is not given: a horizontal field of view of %.0f degrees is assumed. Only "
    "rotation and zoom of a camera can be told, roughly, and nothing can be exported"
)
# As users may type them.
EXAMPLE = {"splat": "point_cloud.ply", "renders": "renders"}
# Folders and files that are called so by every program.
USUAL = re.compile(
    r"renders?|rgb|images?|photos|input|train|test|val|eval|output|outputs|splats?"
    r"|point_cloud|iteration_\d+|ours_\d+|ply|exports?|dataset",
    re.IGNORECASE,
)


def main(argv=None):
    args = parse(argv)
    what = "splat" if args.splat else "renders"
    if args.splat and args.renders:
        raise ValueError("SPLAT and RENDERS: give one, the splat is rendered here")
    if args.size and not args.splat:
        raise ValueError("--size: goes with SPLAT alone: renders have their own")
    for name in ("photos", what, *["cameras"] * bool(args.splat)):
        configs.needed(
            getattr(args, name),
            name.upper(),
            f"make judge PHOTOS=photos {what.upper()}={EXAMPLE[what]} CAMERAS=sparse/0",
            f"why-blurry judge --photos photos --{what} {EXAMPLE[what]} "
            "--cameras sparse/0",
        )
    configs.remember("judge", args)
    for key in ("photos", "renders", "splat", "cameras", "depth"):
        if path := getattr(args, key):
            setattr(args, key, str(typed.judged(key.upper(), path)))
    name = args.name or new_name(args)
    if args.before is None:
        args.before = last_of(args.photos, name)
    check_before(args.before, name)
    with results.held(name):
        run(name, args)


def run(name, args):
    """Find the pairs, write the config, and run it."""
    path = Path("results") / f"{name}.yaml"
    if args.splat:
        render_splat(name, path, args)
    scene = scene_of(args)
    check_kept(path, name, args)
    judged = views.find(of_scenes.checked(scene))
    splits = views.splits_of(judged)
    there = [split for split in prepared.SPLITS if split in splits.values()]
    scene["external_renders"]["splits"] = there
    print(f"{len(judged.pairs)} pairs of photo and render, {judged.told['layout']}")
    print(held_out(judged, splits))
    if not args.cameras:
        log.warning(ASSUMED, camera_files.ASSUMED_DEGREES)
    if args.before:
        print(f"compared with results/{args.before} (--before none: with nothing)")
    configs.say_where(path, config_of(name, scene, judged), args.renders, by="judge")
    print(f"page, when it is finished: {targets.page_of(name)}", flush=True)
    if args.only_config:
        return
    if code := workflow.run(path, args.cores, "all"):
        sys.exit(code)


def check_kept(path, name, args):
    """ValueError where a user's own config says otherwise what was held out."""
    if not (args.held_out and path.is_file()) or configs.is_untouched(path):
        return
    scene = configs.read(path)["scenes"].get(name)
    kept = scene.get("test_every") if isinstance(scene, dict) else None
    if kept != args.held_out:
        raise ValueError(
            f"--held-out: you edited {path}, and test_every is {kept} there: change it "
            "there"
        )


def held_out(judged, splits):
    """Which views count as held out, in a line."""
    count = sum(split == "test" for split in splits.values())
    if how := judged.told["held_out"]:
        return f"{count} of {len(splits)} were held out: {how}"
    every = "--held-out every=8"
    every = provenance.typed(f'OPTIONS="{every}"', every)
    return (
        "no file says which photos were held out, so all count as trained on: if it "
        f"was every eighth by name, add {every}, or sort the renders into folders "
        "train and test"
    )


def render_splat(name, path, args):
    """Render the splat at the photos' cameras; the renders are then those to judge.

    Nothing is done where these are there. All that can be refused is, before.
    """
    place, own, files = SPLATS / name, typed.at_home(args.splat), splat_files(args)
    args.renders, args.depth = str(place / "rgb"), str(place / "depth")
    written = [Path("results", "logs"), Path("results", name), place]
    given = {"PHOTOS": args.photos, "SPLAT": args.splat, "CAMERAS": args.cameras}
    results.check_reads({str(real(one)): key for key, one in given.items()}, written)
    owned.check(Path("results", name))
    configs.check_there(path, {"scenes": {name: scene_of(args)}}, "judge")
    if splat.is_of(place, files, args.background, args.size):
        print("renders of the splat are there already")
        return
    if (Path("results", name) / "verdict.json").is_file():
        raise ValueError(
            f"results/{name}: of another splat, or of one that has changed since: give "
            "another name (--name), or none"
        )
    cameras = views.taken(*map(typed.at_home, (args.photos, args.cameras)))
    if SPLATS.exists() and not SPLATS.is_dir():
        raise ValueError(f"{SPLATS}: not a folder: move it away")
    try:
        SPLATS.mkdir(parents=True, exist_ok=True)
        atomic.sweep(SPLATS)
        with light.interruptible():
            told = splat.render(own, cameras, place, files, args.background, args.size)
    finally:
        results.remove_empty(SPLATS)
    print("{gaussians:,} Gaussians rendered, their world {world}".format(**told))


def splat_files(args):
    """All files that renders of a splat are made from."""
    own = typed.at_home(args.splat)
    if own.is_dir():
        raise ValueError(f"{own}: a folder: SPLAT is the .ply itself")
    place, found = views.photos_of(typed.at_home(args.photos))
    files = camera_files.files_of(typed.at_home(args.cameras))
    return [own, *files, *(place / path for path in found)]


def new_name(args):
    """Results' name after photos and model; numbered where others have it.

    The same photos and renders, unchanged, have the results that they had: an
    interrupted judgement goes on.
    """
    of, model = telling(args.photos), telling(args.splat or args.renders)
    name = folders.free("_".join(dict.fromkeys(filter(None, (of, model)))))
    for number in itertools.count(1):
        one = name if number == 1 else f"{name}_{number}"
        at_work = results.lock_of(one).exists()
        if at_work or is_free(one) or is_same(one, args):
            return one


def is_free(name):
    """Whether there is nothing of a name but, at most, a mark of this program."""
    place = Path("results", name)
    if Path("results", f"{name}.yaml").exists():
        return False
    if not owned.is_marked(place):
        return not os.path.lexists(place)
    return next(owned.files_of(place), None) is None


def telling(path):
    """The innermost name of a path that not every program gives; '' without any."""
    path = faults.resolved(typed.at_home(path))
    inner = path.with_suffix("") if path.suffix.lower() == ".ply" else path
    names = (part for part in reversed(inner.parts[1:]) if not USUAL.fullmatch(part))
    return next(names, "")


def is_same(name, args):
    """Whether results are of the same photos and renders, none of which has changed."""
    path = Path("results", f"{name}.yaml")
    wanted = {"path": args.photos, "cameras": args.cameras, "depth": args.depth}
    wanted["renders"] = args.renders
    if args.splat:
        wanted |= {"renders": SPLATS / name / "rgb", "depth": SPLATS / name / "depth"}
    try:
        scene = configs.read(path)["scenes"].get(name)
        told = configs.inputs_of(path, name, scene)
        own = {key: real(one) for key, one in wanted.items() if one}
        if own != {key: real(one) for key, one in told.items()}:
            return False
        if args.splat and not splat.is_of(
            SPLATS / name, splat_files(args), args.background, args.size
        ):
            return False
        return not originals.changed(Path("results", name))
    except ValueError:
        return False


def real(path):
    return os.path.realpath(typed.at_home(path))


def last_of(photo_folder, name):
    """The name of the last judgement of the same photos, or of what it exported.

    Of results that are there it is what they were compared with.
    """
    path, found = Path("results", f"{name}.yaml"), []
    if path.is_file():
        with contextlib.suppress(ValueError, AttributeError, KeyError, TypeError):
            scene = configs.read(path)["scenes"].get(name)
            before = Path(scene["external_renders"].get("before") or "")
            return before.parent.name if before.is_file() else None
    for verdict in Path("results").glob("*/verdict.json"):
        config, place = verdict.with_name("config.yaml"), verdict.parent
        if not (owned.is_marked(place) and config.is_file()) or place.name == name:
            continue
        # A broken result of before is no reason to stop this one.
        with contextlib.suppress(ValueError):
            scene = configs.read(config)["scenes"].get(place.name)
            own = configs.inputs_of(config, place.name, scene)
            evidence.read_before(verdict, None)
            exported = results.lies_in(photo_folder, place)
            same = "path" in own and real(own["path"]) == real(photo_folder)
            if "renders" in own and (exported or same):
                found.append((verdict.stat().st_mtime_ns, place.name))
    return max(found)[1] if found else None


def scene_of(args):
    """The scene's keys; splits are those that there may be."""
    paths = {key: getattr(args, key) for key in ("renders", "cameras", "depth")}
    judged = {key: str(typed.at_home(path)) for key, path in paths.items() if path}
    if args.before:
        judged["before"] = str(Path("results", args.before, "verdict.json"))
    scene = {"source": "external_renders", "path": str(typed.at_home(args.photos))}
    if args.held_out:
        scene["test_every"] = args.held_out
    return scene | configs.of_photos(args) | {"external_renders": judged}


def check_before(before, name):
    """ValueError where there is no such judgement, or where it is to be written."""
    if not before:
        return
    path = Path("results", before, "verdict.json")
    if before == name:
        raise ValueError(
            f"--before {before}: these results have that name, and replace what was "
            "there: give them another by --name"
        )
    if not path.is_file():
        raise ValueError(f"--before {before}: {path} does not exist")


def config_of(name, scene, judged):
    """The config of renders that are judged."""
    width, height = judged.size
    external = {"renders": scene["external_renders"]["renders"]}
    config = {
        "preflight": False,
        # It tells the same blur in a third of the time.
        "flow": {"blur_by": "dis_fast"},
        "scenes": {name: scene},
        "methods": {THEIRS: {"external": external}},
        "reference": {"method": THEIRS, "round": 0},
    }
    if len(judged.pairs) * width * height > MAX_PIXELS:
        config["flow"]["estimator"] = LARGE
    return config


def every_nth(text):
    """The n of every=n."""
    key, _, number = text.partition("=")
    is_number = number.isascii() and number.isdecimal()
    if key != "every" or not is_number or not 2 <= int(number) <= 10000:
        raise argparse.ArgumentTypeError(f"{text!r}: give every=N, N from 2 to 10000")
    return int(number)


def pixels(text):
    """A side of a photo."""
    if not re.fullmatch(r"[1-9][0-9]{1,4}", text):
        raise argparse.ArgumentTypeError(f"{text!r}: give pixels, from 10 to 99999")
    return int(text)


def parse(argv=None):
    """Arguments of the command line."""
    shared = ("--name", "--cores", "--background", "--pose-convention", "--only-config")
    parser = configs.parser("judge", __doc__, *shared)
    parser.add_argument("--photos", default="", help="folder of the photos")
    parser.add_argument("--renders", default="", help="folder of their renders")
    parser.add_argument(
        "--splat", default="", help="a splat's .ply, rendered here: no --renders then"
    )
    parser.add_argument(
        "--cameras",
        default="",
        help="transforms.json, cameras.json or COLMAP's sparse/0, or the folder of "
        f"one; else a field of view of {camera_files.ASSUMED_DEGREES:.0f} degrees is "
        "assumed",
    )
    parser.add_argument(
        "--depth",
        default="",
        help="folder of the renders' depth along the optical axis, in the unit of the "
        "cameras: <photo>.npy",
    )
    parser.add_argument(
        "--held-out",
        type=every_nth,
        help="every=8: each eighth photo by name was held out; for renders and cameras "
        "that do not say it",
    )
    parser.add_argument(
        "--size",
        type=pixels,
        help="longest side, in px, of the photos that the splat was trained on, where "
        "no file beside it says it",
    )
    parser.add_argument(
        "--before",
        type=lambda text: "" if text == "none" else configs.name(text),
        help="name of earlier results to compare with, or none; else the last ones of "
        "the same photos",
    )
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
