"""Cameras adjusted by keypoints evenly over each view.

Each cell of a view has one keypoint, of the longest track: what moves, and is full of
features, then has no more say than its area. Views whose keypoints do not agree are
placed anew by points that the others see.
"""

import numpy as np
import pycolmap

# Cells across a view's width; each has one keypoint at first, or more where these are
# few. When all views are near, each has several.
CELLS, MIN_KEYPOINTS, SEVERAL = 16, 100, 8
# Loss of keypoints in px, first as in `sfm.bundle`, then narrower: what moves
# hardly counts.
CAUCHY_PX, FINE_PX, TOLERANCE = 0.25, 0.1, 1e-6
# A view agrees by its keypoints that are so near; one with a smaller share of them,
# and so much under the median view's, is placed anew.
NEAR_PX, MIN_AGREEING, UNUSUAL = 0.5, 0.8, 0.1
# Of views: more cannot be placed by the others.
MAX_PLACED = 1 / 3
MIN_POINTS = 12
# A lens that fewer views tell of is not refined.
MIN_VIEWS = 5
# A keypoint that is further off is of no point, as in COLMAP's mapper.
MAX_ERROR_PX, MIN_ANGLE_DEG = 4.0, 1.5
# What of the lens is refined, by name.
FREE = {
    "": (False, False, False),
    "focal": (True, False, False),
    "lens": (True, True, False),
    "centre": (True, True, True),
}


def adjust(model, free, *, without=(), seed=0):
    """Adjust the cameras of COLMAP's model, which changes; returns views placed anew.

    Points that have no say, and what is thinned out, stay: `settle` moves them. free: a
    key of FREE. without: ids of points that have no say.
    """
    chosen = pycolmap.Reconstruction(model)
    for number in without:
        if chosen.exists_point3D(int(number)):
            chosen.delete_point3D(int(number))
    more = pycolmap.Reconstruction(chosen)
    thin_out(chosen)
    solve(chosen, free)
    odd, placed = place_again(chosen, free, seed)
    take_cameras(more, chosen)
    # Those whose keypoints do not agree go on with few: most would pull them back.
    thin_out(more, {n: 1 if n in odd else SEVERAL for n in model.images})
    solve(more, free, loss_px=FINE_PX)
    take_cameras(model, more)
    return placed


def thin_out(model, several=None, least=MIN_KEYPOINTS):
    """Keep keypoints evenly over each view; others are of no point any more.

    several: {image id: keypoints of a cell}; None for one. least: keypoints that a view
    keeps whatever cells they are in.
    """
    view, keypoint, cell, point, length = [], [], [], [], []
    for image in model.images.values():
        for k, one in enumerate(image.points2D):
            if one.has_point3D():
                view.append(image.image_id)
                keypoint.append(k)
                cell.append(cell_of(one.xy, image.camera.width))
                point.append(one.point3D_id)
                length.append(model.points3D[one.point3D_id].track.length())
    columns = [np.array(c, int) for c in (view, keypoint, cell, point, length)]
    view, keypoint, cell, point, length = columns
    # Rank in the cell, by length; then in the view, by that rank.
    order = np.lexsort([point, -length, cell, view])
    rank = np.empty(len(order), int)
    rank[order] = rank_in_group(view[order], cell[order])
    order = np.lexsort([point, -length, rank, view])
    among = np.empty(len(order), int)
    among[order] = rank_in_group(view[order])
    most = np.array([several[n] if several else 1 for n in view.tolist()], int)
    gone = (rank >= most) & (among >= least)
    for number, k in zip(view[gone], keypoint[gone], strict=True):
        # The second last of a point takes the last along.
        if model.images[int(number)].points2D[int(k)].has_point3D():
            model.delete_observation(int(number), int(k))


def cell_of(xy, width):
    """The number of the cell that a keypoint is in."""
    x, y = (int(c // (width / CELLS)) for c in xy)
    return (y + CELLS) * 4 * CELLS + x


def cells_of(model, number):
    """How many cells of a view have a keypoint of a point."""
    image = model.images[number]
    seen = [one.xy for one in image.points2D if one.has_point3D()]
    return len({cell_of(xy, image.camera.width) for xy in seen})


def rank_in_group(*sorted_keys):
    """[n] number of each among those of equal keys, which are sorted."""
    changes = np.zeros(len(sorted_keys[0]), bool)
    for key in sorted_keys:
        changes |= np.diff(key, prepend=-1) != 0
    starts = np.flatnonzero(changes)
    lengths = np.diff([*starts, len(changes)])
    return np.arange(len(changes)) - np.repeat(starts, lengths)


def solve(model, free, *, still=(), loss_px=CAUCHY_PX):
    """Bundle adjustment with a Cauchy loss; views `still` keep their poses."""
    options = options_of(free, loss_px)
    run(model, options, still=still, lenses_still=unsure_lenses(model))


def run(model, options, *, still=(), lenses_still=()):
    """COLMAP's bundle adjustment of all views of the model, which changes.

    `pycolmap.bundle_adjustment` logs whatever the level.
    """
    chosen = pycolmap.BundleAdjustmentConfig()
    for number in model.reg_image_ids():
        chosen.add_image(number)
    for number in still:
        chosen.set_constant_rig_from_world_pose(model.images[number].frame_id)
    for number in lenses_still:
        chosen.set_constant_cam_intrinsics(number)
    if options.refine_rig_from_world:
        chosen.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    pycolmap.create_default_bundle_adjuster(options, chosen, model).solve()


def unsure_lenses(model):
    """Ids of cameras that too few views tell of: their lens stays as it is."""
    counts = dict.fromkeys(model.cameras, 0)
    for number in model.reg_image_ids():
        counts[model.images[number].camera_id] += cells_of(model, number) >= MIN_POINTS
    return [number for number, count in counts.items() if count < MIN_VIEWS]


def settle(model):
    """Adjust the points by the cameras as they are."""
    options = options_of("", FINE_PX)
    options.refine_rig_from_world = False
    run(model, options)
    model.update_point_3d_errors()


def options_of(free, loss_px, loss="CAUCHY"):
    """COLMAP's options; free: a key of FREE, what of the lens is refined."""
    options = pycolmap.BundleAdjustmentOptions()
    (
        options.refine_focal_length,
        options.refine_extra_params,
        options.refine_principal_point,
    ) = FREE[free]
    options.ceres.loss_function_type = getattr(pycolmap.LossFunctionType, loss)
    options.ceres.loss_function_scale = loss_px
    # COLMAP's own goes on for 100 iterations; poses then move by less than 1e-3 px.
    options.ceres.solver_options.function_tolerance = TOLERANCE
    # Sums of several threads come in any order, and trainings by cameras that differ
    # in their last bits differ by 0.1 dB.
    options.ceres.solver_options.num_threads = 1
    options.print_summary = False
    return options


def place_again(model, free, seed):
    """Place views anew whose keypoints do not agree: (their ids, those placed).

    By points of the other views, cell by cell, so that a large part of the view decides
    and not a full one; then all are adjusted again.
    """
    shares = {n: agreeing(model, n) for n in model.reg_image_ids()}
    least = min(MIN_AGREEING, np.median(list(shares.values())) - UNUSUAL)
    odd = sorted((n for n in shares if shares[n] < least), key=shares.get)
    odd = odd[: int(MAX_PLACED * len(shares))]
    if not odd:
        return [], []
    rest, seen = pycolmap.Reconstruction(model), {}
    for number in odd:
        seen[number] = [
            (k, one.point3D_id, one.xy.copy())
            for k, one in enumerate(model.images[number].points2D)
            if one.has_point3D()
        ]
        for k, *_ in seen[number]:
            if rest.images[number].points2D[k].has_point3D():
                rest.delete_observation(number, k)
    solve(rest, free, still=odd)
    placed = []
    for number in odd:
        there = [one for one in seen[number] if rest.exists_point3D(one[1])]
        xy = np.array([one[2] for one in there]).reshape(-1, 2)
        xyz = np.array([rest.points3D[one[1]].xyz for one in there]).reshape(-1, 3)
        if pose := better_pose(rest.images[number], xy, xyz, seed):
            rest.images[number].frame.set_cam_from_world(
                rest.images[number].camera_id, pose
            )
            placed.append(number)
    if placed:
        take_cameras(model, rest)
        settle(model)
        solve(model, free)
    return odd, placed


def agreeing(model, number):
    """Share of a view's keypoints that are near to their points."""
    off = errors_px(model, number)
    return float((off < NEAR_PX).mean()) if len(off) else 0.0


def errors_px(model, number):
    """[k] reprojection errors of a view's keypoints; infinite behind the camera."""
    image, found = model.images[number], []
    for one in image.points2D:
        if one.has_point3D():
            seen = image.project_point(model.points3D[one.point3D_id].xyz)
            found.append(np.inf if seen is None else np.linalg.norm(seen - one.xy))
    return np.array(found)


def better_pose(image, xy, xyz, seed):
    """The pose that more of the points [k, 3] agree with than with the image's own.

    xy [k, 2]: where the image sees them. None where there is none.
    """
    if len(xy) < MIN_POINTS:
        return None
    camera = image.camera
    options = pycolmap.AbsolutePoseEstimationOptions()
    options.ransac.max_error, options.ransac.random_seed = NEAR_PX, seed
    found = pycolmap.estimate_and_refine_absolute_pose(xy, xyz, camera, options)
    if not found or found["num_inliers"] < MIN_POINTS:
        return None
    pose = found["cam_from_world"]
    counts = []
    for one in (image.cam_from_world(), pose):
        seen = xyz @ one.rotation.matrix().T + one.translation
        off = np.linalg.norm(
            camera.img_from_cam(seen, check_cheirality=False) - xy, axis=1
        )
        counts.append(int((off < NEAR_PX).sum()))
    return pose if counts[1] > counts[0] else None


def take_cameras(model, other):
    """Take poses, lenses, and places of points from another model of the same views."""
    for number in other.reg_image_ids():
        image, own = other.images[number], model.images[number]
        own.frame.set_cam_from_world(own.camera_id, image.cam_from_world())
    for number, camera in other.cameras.items():
        model.cameras[number].params = camera.params
    for number, point in other.points3D.items():
        if model.exists_point3D(number):
            model.points3D[number].xyz = point.xyz
