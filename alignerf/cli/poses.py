"""Check and adjust the cameras that came with photos: `make poses FOLDER=my_scan`.

FOLDER holds photos with cameras by an app or another program, as for `make photos`.
Nothing is trained. It prints what is wrong with the cameras, and writes
results/NAME/adjusted/report.json. If bundle adjustment improves them, it also writes
photos, transforms.json, sparse/0 with points and, for LLFF's and NeRF's scenes, their
own files.
"""

import json
import logging
from pathlib import Path

from alignerf.captures import base, typed
from alignerf.cli import configs, folders
from alignerf.experiment.checks import results as of_results
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.exports import formats, points, written
from alignerf.io import atomic, faults, owned, provenance
from alignerf.scenes import prepare, prepared
from alignerf.sfm import calibration, checking, mistakes

log = logging.getLogger("alignerf")

NAME = "adjusted"


def main(argv=None):
    args = parse(argv)
    example = ("make poses FOLDER=my_scan", "why-blurry poses scan")
    configs.needed(args.folder, "FOLDER", *example)
    folder = typed.meant(args.folder, "poses")
    scenes = folders.scenes_of(folder)
    if args.name and len(scenes) > 1:
        raise ValueError(f"--name {args.name}: {folder} has {len(scenes)} scenes")
    faulty = []
    for name, scene in scenes.items():
        try:
            adjust(args.name or name, config_of(scene, args, folder), args)
        except ValueError as error:
            # Others beside it are checked all the same.
            faulty.append(error)
            if len(scenes) > 1:
                log.warning("%s", error)
    if faulty:
        raise faulty[0]


def config_of(scene, args, folder):
    """A scene's keys, complete; ValueError where no cameras came with it."""
    if "adjusted" not in base.every()[scene["source"]].poses:
        command = provenance.as_command("photos", {"FOLDER": folder})
        raise ValueError(
            f"{scene['path']}: no cameras came with these photos, so there are none to "
            f"check: `{command}` finds them by COLMAP"
        )
    return of_scenes.checked(scene | {"poses": "adjusted"} | configs.of_photos(args))


def adjust(name, config, args):
    """Check one scene's cameras, print what they are like, and write better ones."""
    place = Path("results", name)
    of_results.check_reads({config.path: f"scenes.{name}.path"}, [place])
    with of_results.held(name):
        owned.check(place)
        configs.check_there(
            Path(f"{place}.yaml"), {"scenes": {name: config.model_dump()}}, "poses"
        )
        write_adjusted(name, place, config, args)


def write_adjusted(name, place, config, args):
    """The same, into a folder that is this program's."""
    with atomic.scratch_folder(place, name="poses") as scratch:
        views, *_ = base.of(config).read(config, scratch)
        views = mistakes.stated(prepare.sort_by_name(views), config)
        prepared.check_views(config.path, views)
        prepared.check_places(config.path, views)
        checked = checking.check(views, scratch, config, adjusts=True, lens=True)
        print(f"{name}: {len(views.names)} photos, {summary(checked.report)}")
        owned.put(place)
        with atomic.replace_folder(place / NAME) as folder:
            as_it_came = (None, mistakes.NONE)
            alone = not checked.found and config.pose_convention in as_it_came
            if not alone:
                photos_too = not args.no_photos
                write(folder, scratch, views, checked, config, photos_too=photos_too)
            report = checked.report | {"of": str(config.path)}
            (folder / "report.json").write_text(json.dumps(report, indent=1) + "\n")
        print(f"{name}: {place / NAME}" + ", the report alone" * alone, flush=True)


def summary(report):
    """What the check says, in a line."""
    told = report["adjustment"]
    if told["accepted"]:
        named = "; ".join(fault["said"] for fault in report["faults"])
        named = named or "small errors, none of which has a name"
        return (
            f"{named}. Corrected: held-out matches {told['before_px']:.2f} -> "
            f"{told['after_px']:.2f} px"
        )
    return f"cameras stay as they came: {told['why']}"


def write(folder, scratch, views, checked, config, *, photos_too):
    """Write an export of the views by the cameras that the check has found."""
    split = views.split
    if split is None:
        every = base.of(config).every_of(config, len(views.names))
        split = prepare.split_views(len(views.names), test_every=every)
    now = views._replace(split=split)
    if checked.found:
        where = config.path
        now = calibration.applied(now, checked.cameras_of(views), where)
    masked = now.masks is not None
    if photos_too:
        written.write(folder, now, alpha=config.source == "blender")
    arrays = written.arrays_of(now)
    model = points.of_matches(arrays, checked, scratch, config.seed)
    formats.write_colmap(folder, model, arrays)
    formats.write_transforms(
        folder / "transforms.json",
        arrays,
        masked=masked and photos_too,
        points=(folder / formats.POINTS).is_file(),
    )


def parse(argv=None):
    """Arguments of the command line."""
    shared = ("--name", "--background", "--pose-convention")
    parser = configs.parser("poses", __doc__, *shared)
    parser.add_argument("folder", help="photos with cameras, or folders of such")
    parser.add_argument(
        "--no-photos", action="store_true", help="write cameras and points, no photos"
    )
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
