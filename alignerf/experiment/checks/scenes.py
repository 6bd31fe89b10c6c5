"""Scenes: what a source allows, and that its folders are there."""

from alignerf.experiment import schema
from alignerf.experiment.checks.common import check_path_variable, fault, is_there
from alignerf.experiment.keys import scene as scene_keys

# Sources whose photos may have alpha.
TRANSPARENT = ("photos", "transforms", "blender", "judged")
# Sources whose photos may lie in several sizes.
OF_SIZES = ("mipnerf360", "transforms")
# Courtyard's photos, eight bits a channel.
MOST_PHOTO_BYTES = 2**35


def checked(values):
    """A scene's slice of the config with its defaults; ValueError names a fault."""
    config = schema.filled(scene_keys.Scene, values)
    config["poses"] = scene_keys.poses_of(config)
    config["seed"] = config["seed"] or 0
    config["refine_keypoints"] = scene_keys.refines_keypoints(config)
    check_scene(config)
    return config


def check_scene(scene, *place):
    """What the keys of a scene ask of each other; `place` are the keys above them."""
    where = "".join(f"{key}." for key in place)
    source = scene_keys.SOURCES[scene["source"]]
    if scene["poses"] not in source.poses:
        fault(
            f"{where}poses",
            f"{scene['poses']!r} is not possible for source {scene['source']!r}, only "
            + " or ".join(source.poses),
        )
    if source.has_path and not scene["path"]:
        fault(f"{where}path", f"source {scene['source']!r} needs one")
    if scene["images"] is not None and scene["source"] not in OF_SIZES:
        fault(f"{where}images", f"source {scene['source']!r} has no such folders")
    if scene["background"] and scene["source"] not in TRANSPARENT:
        fault(f"{where}background", f"source {scene['source']!r} has no alpha")
    if scene["masks"] and scene["source"] != "photos":
        fault(f"{where}masks", f"only of source 'photos', not {scene['source']!r}")
    if scene["poses"] == "adjusted" and scene["triangulate"] is False:
        fault(f"{where}triangulate", "adjusted poses need matches")
    if scene["poses"] not in scene_keys.INPUT and scene["pose_convention"]:
        fault(f"{where}pose_convention", "only of cameras that came with the photos")
    model = scene["colmap"]["camera_model"]
    if source.has_truth and model not in (None, "PINHOLE", "SIMPLE_PINHOLE"):
        # Undoing a distortion that is not there would move photos off their true flow.
        fault(f"{where}colmap.camera_model", f"courtyard is a PINHOLE, not {model}")
    zooms = scene["courtyard"]["zooms"]
    if scene["poses"] == "colmap" and source.has_truth and set(zooms) != {1}:
        # COLMAP is told of one camera for all photos.
        fault(f"{where}courtyard.zooms", "other than 1 needs poses: truth")
    views, width, height = (scene["courtyard"][k] for k in ("views", "width", "height"))
    if 1 < len(zooms) > views // scene_keys.every_of(scene, views):
        reason = f"{len(zooms)} of them are more than there are test views"
        fault(f"{where}courtyard.zooms", reason)
    check_zoom(scene["zoom"] or {}, f"{where}zoom")
    check_judged(scene, where)
    if source.has_truth and 3 * views * width * height > MOST_PHOTO_BYTES:
        size = f"{views} photos of {width}x{height} are more than"
        fault(f"{where}courtyard", f"{size} {MOST_PHOTO_BYTES / 2**30:g} GiB")


def check_judged(scene, where):
    """The pairs that are judged stay as they are: nothing of them is made smaller."""
    judged = scene["judged"]
    if (scene["source"] == "judged") != bool(judged):
        fault(f"{where}judged", "goes with source 'judged', and that with it")
    if not judged:
        return
    for key, usual in (("downscale", 1), ("zoom", None), ("perturb_px", 0)):
        if scene[key] != usual:
            fault(f"{where}{key}", "not of renders that are judged")


def check_zoom(zoom, where):
    """The point of the windows is said in one way, or chosen."""
    if (zoom.get("view") is None) != (zoom.get("pixel") is None):
        fault(where, "view and pixel belong together")
    ways = [key for key in ("view", "point", "number", "of") if zoom.get(key)]
    if len(ways) > 1:
        fault(where, f"{' and '.join(ways)}: choose one")
    for name in ("cameras", "count"):
        if zoom.get(name, 1) not in (None, 1) and not zoom.get("of"):
            fault(f"{where}.{name}", "only with `of`")


def check_windows(config):
    """Scenes and methods that windows are of are in the config."""
    for name, scene in config["scenes"].items():
        zoom, where = scene["zoom"] or {}, f"scenes.{name}.zoom"
        if not (of := zoom.get("of")):
            continue
        base = config["scenes"].get(of)
        if base is None or base["zoom"]:
            fault(f"{where}.of", f"{of} is none of the scenes that are whole")
        if (base["source"], base["path"]) != (scene["source"], scene["path"]):
            fault(f"{where}.of", f"{of} has another source or path than {name}")
        method = zoom["cameras"]
        if method and not config["methods"].get(method, {}).get("align"):
            fault(f"{where}.cameras", f"{method} is no method with `align`")


def check_path(scene, name):
    """The folders of a scene are there, their names without meaning for Snakemake."""
    judged = scene["judged"] or {}
    paths = {key: scene[key] for key in ("path", "masks")}
    paths |= {
        f"judged.{k}": judged.get(k) for k in ("renders", "cameras", "depth", "before")
    }
    for key, path in paths.items():
        where = f"scenes.{name}.{key}"
        if path and set(path) & set("{}"):
            fault(where, f"{path}: braces mean wildcards, rename it")
        check_path_variable(where, path or "")
        if path and not is_there(path):
            fault(where, f"{path} does not exist")
