"""The kind of a folder: photos, films, or photos with cameras by an app or program.

Files are told by their names, and none is opened. A folder of such folders holds
several scenes.
"""

import collections
import logging
import math
import re
from pathlib import Path

import numpy as np

from alignerf.captures import base, typed
from alignerf.colmap import video
from alignerf.experiment import sources, targets
from alignerf.experiment.checks import names
from alignerf.io import faults
from alignerf.scenes import photo_names, photos

log = logging.getLogger("alignerf")

RULE = re.compile(r"^\s*(?:rule|checkpoint|use rule \w+ as) (\w+)", re.MULTILINE)


# Minutes of COLMAP on two cores by number of photos, of 2 to 12 megapixels; of 150 as a
# pair's time has it (docs/evidence/costs.md).
COLMAP_MIN = {24: 2, 50: 3, 150: 40, 300: 84}

# What a phone's own poses get beside them: the same photos, posed by COLMAP.
BY_COLMAP = "colmap"


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
        hidden = inner.name.startswith(".") or typed.is_trained(inner)
        if not hidden and (own := scene_of(inner)) is not None:
            name = name_of(inner)
            if name in scenes:
                raise ValueError(f"{inner}: another scene is called {name} too")
            scenes[name] = own
    if not scenes:
        raise ValueError(
            f"{folder}: no photos ({', '.join(sorted(photos.SUFFIXES))}), no videos "
            f"({', '.join(sorted(video.SUFFIXES))}) and no folders of either"
            f"{there(folder)}"
        )
    return scenes


def there(folder):
    """What a folder has instead, by its files' suffixes: '; 24 .cr2 and 1 .txt'."""
    files = folder.iterdir() if folder.is_dir() else ()
    counts = collections.Counter(p.suffix.lower() for p in files if p.is_file())
    counts.pop("", None)
    some = (f"{count} {faults.name_of(s, 20)}" for s, count in counts.most_common(3))
    return f"; it holds {' and '.join(some)}" if counts else ""


def scene_of(path):
    """The keys of one scene; None where there is none. ValueError as of `detected`."""
    capture = base.detected(path)
    if capture is None:
        return None
    if (path / "masks").is_dir() and "masks" not in capture.keys:
        log.warning("%s/masks: not used where cameras are given", path)
    if (path / "mask").is_dir() and not (path / "masks").is_dir():
        # Those of a transforms.json may be named in it.
        told = "%s/mask: not looked through for masks: they lie in a folder masks"
        log.warning(told, path)
    return capture.scene(path)


def check_enough(scenes):
    """Raise ValueError where no scene has enough photos to be posed: COLMAP need not
    run to tell. Others go on beside one that has too few.
    """
    counts = {scene["path"]: count_of(scene) for scene in scenes}
    few = {p: n for p, n in counts.items() if n is not None and n < photos.LEAST}
    if few and few == counts:
        path, count = next(iter(few.items()))
        photos.check_enough(count, path)


def count_of(scene):
    """How many photos of a folder COLMAP is to pose.

    None of an app or of given cameras, and where there are films, which give as many as
    they are long. A Live Photo's film, called like a photo, is none.
    """
    path = Path(scene["path"])
    if base.every()[scene["source"]].poses[0] != BY_COLMAP or not path.is_dir():
        return None
    inside = photo_names.photos_of([p.name for p in path.iterdir() if p.is_file()])
    taken = [path / name for name in inside if video.is_taken(path / name)]
    stems = {p.stem for p in taken if p.suffix.lower() in photos.SUFFIXES}
    films = [p for p in taken if p.suffix.lower() in video.SUFFIXES]
    if any(film.stem not in stems for film in films):
        return None
    return len(taken) - len(films) if taken else len(photo_names.listed(path))


def colmap_min(count):
    """Minutes that COLMAP may take to pose so many photos on two cores."""
    counts, minutes = np.log(list(COLMAP_MIN)), np.log(list(COLMAP_MIN.values()))
    found = math.exp(np.interp(math.log(count), counts, minutes))
    return found * max(count / max(COLMAP_MIN), 1)


def with_colmap(scenes):
    """The scenes, and beside each with a phone's own poses NAME_colmap.

    Raises ValueError where there is another scene of that name.
    """
    found = {}
    for name, scene in scenes.items():
        found[name] = scene
        if base.every()[scene["source"]].tracked_by_phone(scene["path"]):
            if (again := f"{name}_{BY_COLMAP}") in scenes:
                raise ValueError(f"{scene['path']}: another scene is called {again}")
            found[again] = scene | {"poses": BY_COLMAP}
    return found


def name_of(path):
    """A scene's name after a folder or film: letters that files and rules can have."""
    path = faults.resolved(path)
    if path.name == "images":
        path = path.parent
    return free(path.stem if path.is_file() else path.name)


def free(text):
    """A text as a name of those letters, which nothing else has in results/."""
    text = re.sub(r"[^A-Za-z0-9_-]+", "_", text).strip("_-")[:60] or "photos"
    fits = text not in taken_names() and not names.PERIODIC.search(text)
    return text if fits else f"{text}_photos"


def taken_names():
    """Names that no scene may have: of rules, the demo, and what lies in results/."""
    rules = sources.PIPELINE / "workflow" / "rules"
    files = [sources.PIPELINE / "Snakefile", *rules.rglob("*.smk")]
    found = {name for file in files for name in RULE.findall(file.read_text())}
    return found | names.FILES | {*targets.demo_scenes()}
