"""The embedded scene: its photos are rendered, and its truth is known."""

import logging
from typing import Literal

from alignerf.captures import base
from alignerf.courtyard import OBJECTS
from alignerf.experiment.keys.key import Keys, key

log = logging.getLogger("alignerf.poses")

# Courtyard's photos, eight bits a channel.
MAX_PHOTO_BYTES = 2**35


class Courtyard(Keys):
    place: Literal["courtyard", "object"] = key(
        "courtyard", "all of it, or its boxes and arm alone before white"
    )
    views: int = key(48, "number of photos", least=4, most=10000)
    zooms: list[float] = key(
        [1.0],
        "focal lengths, in turn, in units of one that sees 60 degrees; other than 1 "
        "with true poses only",
        least=0.1,
        most=10,
        length=(1, 16),
    )
    width: int = key(400, "of a photo in px", least=32, most=16384)
    height: int = key(300, "of a photo in px", least=32, most=16384)
    motion: Literal["none", "uniform", "two_states"] = key(
        "uniform",
        "how objects move between photos: not, by a uniform displacement, or between "
        "two states of probability 0.5 (the paper's moving arm)",
    )
    motion_m: float = key(0.02, "largest displacement in meters", least=0, most=10)
    moving: list[Literal[OBJECTS]] | None = key(
        None, "objects that move; null: all that can", length=(0, 1000)
    )
    # Leaves as much near the highest frequency as a real photo made smaller has:
    # unblurred textures lose ten times more than photos when they are resampled.
    lens_sigma_px: float = key(
        1.4, "sigma of the lens's blur, in px of the photo", least=0, most=100
    )
    supersample: int = key(2, "rays a pixel and axis", least=1, most=16)


class CourtyardCapture(base.Capture):
    name = "courtyard"
    what = "embedded scene"
    poses = ("colmap", "truth")
    section = (Courtyard, key(Courtyard, "of source courtyard: the embedded scene"))
    has_truth = True
    has_path = False

    def read(self, scene, scratch):
        from alignerf.colmap import loading

        log.info("rendering %d photos of the courtyard", scene.courtyard.views)
        views, true = rendered(scene, scratch)
        if scene.poses == "colmap":
            return *by_colmap(scratch / "photos", scratch, true, scene), true
        return views, loading.registration(true.names, []), true

    def at_full_size(self, scene, folder, scratch):
        return rendered(scene, scratch)[0]

    def faults(self, scene):
        model = scene.colmap.camera_model
        if model not in (None, "PINHOLE", "SIMPLE_PINHOLE"):
            # Undoing a distortion that is not there would move photos off their flow.
            yield "colmap.camera_model", f"courtyard is a PINHOLE, not {model}"
        own = scene.courtyard
        zooms, views = own.zooms, own.views
        if self.poses_of(scene) == "colmap" and set(zooms) != {1}:
            # COLMAP is told of one camera for all photos.
            yield "courtyard.zooms", "other than 1 needs poses: truth"
        if 1 < len(zooms) > views // self.every_of(scene, views):
            reason = f"{len(zooms)} of them are more than there are test views"
            yield "courtyard.zooms", reason
        if 3 * views * own.width * own.height > MAX_PHOTO_BYTES:
            size = f"{views} photos of {own.width}x{own.height} are more than"
            yield "courtyard", f"{size} {MAX_PHOTO_BYTES / 2**30:g} GiB"


def rendered(scene, scratch):
    """(views with true cameras, the truth): photos are rendered into a folder."""
    from alignerf.courtyard import scene as courtyard
    from alignerf.courtyard import truth
    from alignerf.io import images
    from alignerf.scenes import prepare

    folder, made = scratch / "photos", dict(scene.courtyard)
    folder.mkdir()
    if made["moving"] is None:
        made["moving"] = list(courtyard.MOVING)
    true = truth.build_courtyard(**made, seed=scene.seed)
    truth.write_photos(folder, true)
    views = prepare.PosedViews(
        names=true.names,
        pixtocams=true.pixtocams,
        camtoworlds=true.camtoworlds,
        width=true.width,
        height=true.height,
        photos=[
            prepare.Photo(folder / f"{name}.png", (images.read,)) for name in true.names
        ],
    )
    return views, true


def by_colmap(folder, scratch, true, scene):
    """The courtyard's photos through COLMAP, the frame aligned to the true one.

    The focal length is COLMAP's own, as for photos without EXIF: it comes within
    0.2 % of the true one, and holding that one changed little. What is left is the
    work of the moving objects: with 48 views of 400x300, the estimated cameras see
    the still scene 0.77 px of a 200x150 image from where it is on average, and
    0.07 px when nothing moves.
    """
    from alignerf.colmap import loading
    from alignerf.courtyard import truth
    from alignerf.scenes import cameras

    views, told, _ = loading.by_colmap(
        folder, scratch, scene, where="courtyard", camera_model="SIMPLE_PINHOLE"
    )
    true = truth.select(true, views.names)
    similarity = cameras.align_similarity(views.camtoworlds, true.camtoworlds)
    (scale, rotation, translation), (points, colours) = similarity, views.points
    views = views._replace(
        camtoworlds=cameras.apply_similarity(views.camtoworlds, *similarity),
        points=(scale * points @ rotation.T + translation, colours),
    )
    return views, told


CAPTURE = CourtyardCapture()
