"""The photos of a prepared scene once more, at their own size.

What `alignerf.poses` found is taken from the scene's folder, so COLMAP does not run:
the lenses from `prepared.LENSES`, the cameras from cameras.npz or from another file of
the same views.
"""

from pathlib import Path

import numpy as np

from alignerf.files import archives, faults, images
from alignerf.scenes import (
    blender,
    cameras,
    distortion,
    llff,
    mipnerf360,
    prepare,
    prepared,
    transforms,
)
from alignerf.scenes.apps import polycam, record3d, scanner3d, sources
from alignerf.scenes.capture import canvas, ingest
from alignerf.scenes.courtyard import scene as courtyard
from alignerf.scenes.courtyard import truth
from alignerf.scenes.judged import views as judged

# Sources whose files give the poses -> (views, names of photos without a pose).
GIVEN = {
    "transforms": lambda config: transforms.read(
        config["path"], config["background"], images=config["images"]
    ),
    "llff": lambda config: (llff.read(config["path"]), []),
    "mipnerf360": lambda config: mipnerf360.read(config["path"], config["images"]),
    "blender": lambda config: blender.read(config["path"], config["background"]),
    "judged": judged.at_full_size,
    "polycam": lambda config: polycam.read(config["path"]),
    "scanner3d": lambda config: scanner3d.read(config["path"]),
    "record3d": lambda config: record3d.read(config["path"]),
}
OF_LENS = ("camtopix", "distortion")
OF_LENSES = ("names", "camtopix", "distortion", "camera_of")


def read(config, folder, work_folder, cameras_path=None) -> prepare.PosedViews:
    """The views of a prepared scene at the size of its photos, in its own order.

    config: the scene's keys, complete. folder: its folder of results. work_folder:
    existing; files that the photos are read from may be written there. cameras_path:
    another cameras.npz of the same views. Photos are read when they are needed, and
    undistorted then. Raises ValueError where the photos are not those that the scene
    was made of.
    """
    folder = Path(folder)
    arrays = prepared.read_cameras(cameras_path or folder / "cameras.npz")
    views = photos_of(config, folder, Path(work_folder))
    place = {name: i for i, name in enumerate(views.names)}
    names = arrays["names"].tolist()
    if gone := [name for name in names if name not in place]:
        where = config["path"] or config["source"]
        raise ValueError(f"{where}: the photo of view {faults.shown(gone[0])} is gone")
    views = prepare.select(views, [place[name] for name in names])
    if (folder / prepared.LENS).is_file():
        views = relensed(views, archives.read(folder / prepared.LENS, OF_LENS))
    across = views.width / arrays["width"], views.height / arrays["height"]
    if not np.allclose(*across, rtol=prepare.SAME_SHAPE - 1):
        raise ValueError(
            f"{config['path']}: photos of {views.width}x{views.height} are no longer "
            f"those that {folder / 'cameras.npz'} was made of"
        )
    return views._replace(
        pixtocams=cameras.rescale_intrinsics(arrays["pixtocams"], *across),
        camtoworlds=arrays["camtoworlds"],
        points=points_of(folder),
        bounds=None,
        split=arrays["split"],
    )


def relensed(views, lens):
    """The views with the distortion undone that adjusting has found."""
    return distortion.pinhole_views(
        views.names,
        list(zip(lens["camtopix"], lens["distortion"], strict=True)),
        views.camtoworlds,
        width=views.width,
        height=views.height,
        photos=views.photos,
        masks=views.masks,
        where=prepared.LENS,
    )


def points_of(folder):
    """The points and colours of a prepared scene, or None."""
    path = folder / prepared.POINTS
    if not path.is_file():
        return None
    arrays = archives.read(path, ["points", "colours"])
    return arrays["points"], arrays["colours"]


def photos_of(config, folder, work_folder):
    """The views of a scene's source; their cameras are those of the source."""
    if config["source"] in sources.APPS and config["poses"] == "colmap":
        links = sources.link_photos(config["source"], config["path"], work_folder)
        return of_photos(config | {"path": str(links)}, folder, work_folder)
    if config["source"] in GIVEN:
        return GIVEN[config["source"]](config)[0]
    if config["source"] == "photos":
        return of_photos(config, folder, work_folder)
    rendered = work_folder / "photos"
    rendered.mkdir()
    return of_courtyard(config, rendered)[0]


def of_photos(config, folder, work_folder):
    """Photos that COLMAP posed, undistorted by the lenses that it found."""
    path = folder / prepared.LENSES
    lenses = archives.read(path, OF_LENSES)
    taken = ingest.once_more(
        config["path"],
        work_folder,
        background=config["background"],
        masks=config["masks"],
    )
    place = {name: i for i, name in enumerate(taken.names)}
    names = lenses["names"].tolist()
    if gone := [name for name in names if name not in place]:
        raise ValueError(f"{config['path']}: the photo {faults.shown(gone[0])} is gone")
    kept = [place[name] for name in names]
    return canvas.views_of(
        names,
        list(zip(lenses["camtopix"], lenses["distortion"], strict=True)),
        [taken.sizes[i] for i in kept],
        np.tile(np.eye(4)[:3], (len(kept), 1, 1)),
        camera_of=lenses["camera_of"].tolist(),
        photos=[prepare.Photo(i, (taken.load,)) for i in kept],
        masks=config["masks"] and [prepare.Photo(i, (taken.load_mask,)) for i in kept],
        where=config["path"],
    )


def of_courtyard(config, folder):
    """(views with true cameras, the scene): its photos are rendered into a folder."""
    made = config["courtyard"]
    if made["moving"] is None:
        made = made | {"moving": list(courtyard.MOVING)}
    scene = truth.build_courtyard(**made, seed=config["seed"])
    truth.write_photos(folder, scene)
    views = prepare.PosedViews(
        names=scene.names,
        pixtocams=scene.pixtocams,
        camtoworlds=scene.camtoworlds,
        width=scene.width,
        height=scene.height,
        photos=[
            prepare.Photo(folder / f"{name}.png", (images.read,))
            for name in scene.names
        ],
    )
    return views, scene
