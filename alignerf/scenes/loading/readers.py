"""The reader of each source: views at full size, and the report so far."""

import logging

from alignerf.scenes import cameras, colmap
from alignerf.scenes.apps import sources
from alignerf.scenes.capture import full_size, report
from alignerf.scenes.courtyard import truth
from alignerf.scenes.judged import views as judged

log = logging.getLogger("alignerf.poses")


def load_photos(config, scratch):
    """Photos by COLMAP: (views at full size, the report so far, no truth)."""
    views, told = pose_photos(config["path"], scratch, config, camera_model="OPENCV")
    return views, told, None


def load_given(config, scratch):
    """`load_photos` of a scene whose files give the poses."""
    views, left_out = full_size.GIVEN[config["source"]](config)
    return views, report.registration(views.names, left_out), None


def load_app(config, scratch):
    """`load_photos` of an app's folder: by its own poses, or by COLMAP's."""
    source, path = config["source"], config["path"]
    if config["poses"] == "colmap":
        links = sources.link_photos(source, path, scratch)
        views, told = pose_photos(
            links, scratch, config, camera_model="OPENCV", where=path
        )
        return views, told, None
    views, told, _ = load_given(config, scratch)
    said = sources.said_of(source, path)
    log.info("%s: %s", path, said)
    return views, told | {"of_poses": said}, None


def load_courtyard(config, scratch):
    """`load_photos` of the embedded scene; the third value is its truth."""
    folder = scratch / "photos"
    folder.mkdir()
    log.info("rendering %d photos of the courtyard", config["courtyard"]["views"])
    views, scene = full_size.of_courtyard(config, folder)
    if config["poses"] == "colmap":
        return *pose_courtyard(folder, scratch, scene, config), scene
    return views, report.registration(scene.names, []), scene


def pose_photos(folder, scratch, config, *, camera_model, where=None):
    """Views of a folder of photos by COLMAP, undistorted, and the poses report."""
    views, model, taken = colmap.pose_folder(
        folder,
        scratch,
        camera_model=config["colmap"]["camera_model"] or camera_model,
        max_size_px=config["colmap"]["max_size_px"],
        seed=config["seed"],
        where=where or str(folder),
        background=config["background"],
        masks=config["masks"],
        refine_keypoints=config["refine_keypoints"],
    )
    least = config["colmap"]["least_registered"]
    report.check_registered(model, least, where or folder)
    registration = report.registration(model.names, model.left_out)
    registration |= report.points(model) | report.photos(model, taken)
    return views, registration | {"models": model.models}


def pose_courtyard(folder, scratch, scene, config):
    """The courtyard's photos through COLMAP, the frame aligned to the true one.

    The focal length is COLMAP's own, as for photos without EXIF: it comes within
    0.2 % of the true one, and holding that one changed little. What is left is the
    work of the moving objects: with 48 views of 400x300, the estimated cameras see
    the still scene 0.77 px of a 200x150 image from where it is on average, and
    0.07 px when nothing moves.
    """
    views, told = pose_photos(
        folder, scratch, config, where="courtyard", camera_model="SIMPLE_PINHOLE"
    )
    true = truth.select(scene, views.names)
    similarity = cameras.align_similarity(views.camtoworlds, true.camtoworlds)
    (scale, rotation, translation), (points, colours) = similarity, views.points
    views = views._replace(
        camtoworlds=cameras.apply_similarity(views.camtoworlds, *similarity),
        points=(scale * points @ rotation.T + translation, colours),
    )
    told["compared_to_truth"] = truth.compare_cameras(
        (views.pixtocams, views.camtoworlds), (true.pixtocams, true.camtoworlds)
    )
    return views, told


# Source, as `scene_keys.SOURCES` has them -> its reader.
READERS = {
    "courtyard": load_courtyard,
    "photos": load_photos,
    **dict.fromkeys(full_size.GIVEN, load_given),
    "judged": judged.load,
    **dict.fromkeys(sources.APPS, load_app),
}
