"""The kind of a folder: photos, films, or photos with cameras by another program.

Files are told by their names, and none is opened. A folder of such folders holds
several scenes.
"""

import logging
import re
from pathlib import Path

from alignerf.experiment import sources
from alignerf.scenes import photos
from alignerf.scenes.capture import video

log = logging.getLogger("alignerf")

# Files that say which cameras took the photos, and the source that reads them; in this
# order, as some come together.
CAMERAS = (
    ("transforms_train.json", "blender"),
    ("transforms.json", "transforms"),
    ("sparse/0", "mipnerf360"),
    ("poses_bounds.npy", "llff"),
)
RULE = re.compile(r"^\s*(?:rule|checkpoint|use rule \w+ as) (\w+)", re.MULTILINE)


def scenes_of(folder):
    """{name: {source, path}} of the scenes in a folder.

    Raises ValueError, naming the known kinds of files, where there is no scene.
    """
    folder = Path(folder)
    if not folder.exists():
        raise ValueError(f"{folder} does not exist")
    if (own := scene_of(folder)) is not None:
        return {name_of(folder): own}
    scenes = {}
    for inner in sorted(folder.iterdir()) if folder.is_dir() else ():
        if not inner.name.startswith(".") and (own := scene_of(inner)) is not None:
            name = name_of(inner)
            if name in scenes:
                raise ValueError(f"{inner}: another scene is called {name} too")
            scenes[name] = own
    if not scenes:
        raise ValueError(
            f"{folder}: no photos ({', '.join(sorted(photos.SUFFIXES))}) and no films "
            f"({', '.join(sorted(video.SUFFIXES))}), nor folders of such"
        )
    return scenes


def scene_of(path):
    """{source, path} of one scene; None where there is none."""
    if path.is_dir():
        for name, source in CAMERAS:
            if (path / name).exists():
                # A transforms.json names them itself.
                if (path / "masks").is_dir() and source != "transforms":
                    log.warning("%s/masks: not used where cameras are given", path)
                return {"source": source, "path": str(path)}
        if not any(is_taken(p) for p in path.iterdir()):
            # As other programs lay it out.
            path = path / "images"
            if not (path.is_dir() and any(is_taken(p) for p in path.iterdir())):
                return None
        masks = [p for p in (path / "masks", path.parent / "masks") if p.is_dir()]
        inner = masks and (masks[0].parent == path or path.name == "images")
        return {"source": "photos", "path": str(path)} | (
            {"masks": str(masks[0])} if inner else {}
        )
    film = path.is_file() and path.suffix.lower() in video.SUFFIXES
    return {"source": "photos", "path": str(path)} if film else None


def is_taken(path):
    """Whether a file is a photo or a film, by its name."""
    suffixes = photos.SUFFIXES | video.SUFFIXES
    return path.suffix.lower() in suffixes and not path.name.startswith(".")


def name_of(path):
    """A scene's name after a folder or film: letters that files and rules can have."""
    path = Path(path).resolve()
    if path.name == "images":
        path = path.parent
    text = re.sub(r"[^A-Za-z0-9_-]+", "_", path.stem if path.is_file() else path.name)
    text = text.strip("_-")[:60] or "photos"
    return f"{text}_photos" if text in taken_names() else text


def taken_names():
    """Names of the rules and of folders of the results, which no scene may have."""
    files = [sources.ROOT / "Snakefile", *(sources.ROOT / "workflow").rglob("*.smk")]
    rules = {name for file in files for name in RULE.findall(file.read_text())}
    return rules | {"published", "bench", "logs"}
