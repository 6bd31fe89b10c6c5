"""Train on photos, and say on a page what blurs them: `make photos FOLDER=my_photos`.

FOLDER holds photos (also HEIC), videos, or photos with cameras by another program
(transforms.json, sparse/0, poses_bounds.npy) or an app (Polycam's raw data, 3d Scanner
App's All Data, Record3D's EXR + JPG), or several such folders. A small NeRF is trained,
and a page says what blurs it. The config, results/NAME.yaml, is yours to edit.
"""

import logging
import sys
from pathlib import Path

from alignerf.captures import base, typed
from alignerf.cli import configs, folders, light, workflow
from alignerf.experiment import check, layout, plan, targets
from alignerf.experiment.checks import results
from alignerf.io import faults
from alignerf.judged import originals
from alignerf.scenes import photos

log = logging.getLogger("alignerf")


def main(argv=None):
    args = parse(argv)
    example = (command.format("my_photos") for command in configs.PHOTOS)
    configs.needed(args.folder, "FOLDER", *example)
    configs.remember("photos", args)
    folder = typed.meant(args.folder, "photos")
    scenes = folders.scenes_of(folder)
    name = args.name or folders.name_of(folder)
    if args.name and len(scenes) == 1:
        scenes = {args.name: next(iter(scenes.values()))}
    scenes = folders.with_colmap(scenes)
    with results.held(name, *scenes):
        run(name, scenes, folder, args)


def run(name, scenes, folder, args):
    """Write the config of scenes, say what they are, and run it."""
    path = Path("results") / f"{name}.yaml"
    configs.say_where(path, config_of(scenes, args), folder)
    scenes = still_in(path, scenes)
    try:
        folders.check_enough(scenes.values())
    except ValueError as error:
        if not args.only_config:
            raise
        log.warning("%s", error)
    for scene, content in scenes.items():
        by = " by COLMAP" if content.get("poses") == folders.BY_COLMAP else ""
        place = faults.one_line(content["path"])
        print(f"{scene}: {content['source']} in {place}{by}")
    say_how_long(scenes)
    if args.budget_min is not None:
        print(
            f"{args.budget_min:g} min for each training. Renders, flow, scores, crops "
            "and figures come on top"
        )
    say_twice(path, scenes)
    pages = list(map(targets.page_of, scenes))
    print(f"page, when it is finished: {', '.join(pages)}", flush=True)
    if args.only_config:
        return
    anew, plans = anew_of(scenes), plans_of(path, scenes)
    if plans:
        code = workflow.run(path, args.cores, *plans.values(), forced=anew)
        left = [n for n in scenes if n not in plans or Path(plans[n]).exists()]
        # Others go on beside a scene that cannot be planned.
        if code and left and code != light.STOPPED:
            workflow.run(path, args.cores, *all_of(path, left))
        if code:
            sys.exit(code)
        anew = []
    # Its files for other programs, too: cameras corrected, or as given.
    wanted = ("all", "export")
    if code := workflow.run(path, args.cores, *wanted, first=pages, forced=anew):
        sys.exit(code)


def plans_of(path, scenes):
    """{scene: file that says what it will cost}: made before anything is trained.

    In one plan with trainings it may come after them: it wants all cores.
    """
    if configs.read(path).get("preflight") is False:
        return {}
    trained = (
        name for name, one in scenes.items() if base.every()[one["source"]].trains
    )
    return {name: str(layout.Scene(name).preflight) for name in trained}


def all_of(path, scenes):
    """All that a run makes of some scenes: pages, and files for other programs."""
    whole = check.checked(configs.read(path), [path])
    exports = targets.exports(plan.Experiment(whole))
    return [*scenes, *(one for one in exports if Path(one).parts[1] in scenes)]


def anew_of(scenes):
    """The poses of scenes whose photos have changed in their place, which is said."""
    places = {name: Path("results", name) for name in scenes}
    found = {name: originals.changed(place) for name, place in places.items()}
    for name, files in found.items():
        if files:
            few = faults.some_names(files)
            print(
                f"{name}: photos have changed, so everything is computed again: {few}"
            )
    return [str(places[name] / "poses.json") for name, files in found.items() if files]


def still_in(path, scenes):
    """The scenes that a config has, as it has them: a user may have edited them."""
    there = configs.read(path)["scenes"]
    return {n: {**one, **(there[n] or {})} for n, one in scenes.items() if n in there}


def say_how_long(scenes):
    """Print how long COLMAP may take: what the rest takes is measured after it."""
    for name, scene in scenes.items():
        posed = (Path("results") / name / "poses.json").exists()
        count = None if posed else folders.count_of(scene)
        if count and count >= photos.LEAST:
            minutes = round(folders.colmap_min(count))
            print(
                f"{name}: COLMAP finds the cameras of {count} photos first, in about "
                f"{minutes} min on two cores; then the time of all trainings is printed"
            )


def say_twice(path, scenes):
    """Print that a phone's photos are trained with two kinds of poses, and the cost."""
    if again := [s for s, one in scenes.items() if one.get("poses")]:
        print(
            "poses of a phone are off by pixels, so they are compared with COLMAP's "
            "in twice the time. For the phone's alone, delete "
            f"{', '.join(again)} under scenes in {path} (--only-config writes it and "
            "stops)"
        )


def config_of(scenes, args):
    """The config of scenes; the keys that it leaves out follow from the photos."""
    scenes = {n: scene | configs.of_photos(args) for n, scene in scenes.items()}
    methods = {"plain": {}, "auto": {"auto": True}}
    config = {"decide": True, "scenes": scenes, "methods": methods, "crops": {}}
    if args.budget_min is not None:
        config["training"] = {"budget_min": args.budget_min}
    return config


def parse(argv=None):
    """Arguments of the command line."""
    shared = ("--name", "--cores", "--background", "--pose-convention", "--only-config")
    parser = configs.parser("photos", __doc__, *shared)
    parser.add_argument("folder", help="photos or videos, or folders of such")
    parser.add_argument(
        "--budget-min",
        type=configs.minutes,
        help="minutes for each training; rendering, flow and scores come on top",
    )
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
