"""Bundle adjustment of input cameras: triangulate, adjust, triangulate again.

Thresholds start wide, by the cameras' measured error, and close to 4 px. Cameras that
no track holds are placed by the points, or move along with their neighbours. What
comes out is in the frame and at the scale of the input: one similarity takes it back.
"""

from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pycolmap
from jaxtyping import Float, UInt8

from alignerf.colmap import mapping, structure
from alignerf.colmap import triangulate as of_given
from alignerf.io import faults, progress
from alignerf.keypoints import adjustment, readjustment
from alignerf.scenes import cameras
from alignerf.sfm import calibration, pose_error
from alignerf.sfm.calibration import Cameras
from alignerf.sfm.matches import Matches

# Reprojection error in px up to which a keypoint belongs to a point: first, in units
# of the cameras' own error, up to a bound; then half as much each time; last of all, as
# in COLMAP's own mapper.
START, MAX_START_PX, NEAR_PX, LAST_PX = 6.0, 96.0, 6.0, 4.0
# Of the robust loss, in px: while poses are far off, and when they are near. The second
# hardly feels what moves.
SOFT_PX, CAUCHY_PX = 1.0, 0.25
# Of the solver: 1e-6 takes twice as long, and moves no camera by a hundredth of a px.
TOLERANCE = 1e-4
# Matches that are enough to adjust by: more take longer, and move no camera.
MAX_MATCHES = 120_000
# A view with fewer keypoints on points is held by none of them.
MIN_TRACKS = 12
# A pose this many times as wrong as the median one, and by so many px, is not begun
# with.
ASTRAY, MIN_ASTRAY_PX = 8.0, 1.0
# Pairs of views that COLMAP begins new poses with, at most.
TRIALS = 20
# Two focal lengths of a camera that differ by less are one.
SQUARE = 1e-6
# Focal lengths that differ by less are of one physical camera; so are principal points
# within this share of the width.
SAME_FOCAL, SAME_CENTRE = 0.05, 0.02


class TooFewError(ValueError):
    """Too few tracks to adjust cameras by."""


class Points(NamedTuple):
    """Triangulated points [m, 3], their colours, and who sees them.

    seen: of each view, indices of the points that it sees. reprojection_px [n]: mean
    of each view; NaN of one that sees none.
    """

    positions: Float[np.ndarray, "m 3"]
    colours: UInt8[np.ndarray, "m 3"]
    seen: list[np.ndarray]
    reprojection_px: Float[np.ndarray, " n"]

    def of_view(self, view, most=400):
        """Positions of up to `most` points that a view sees, spread over all."""
        seen = self.seen[view]
        return self.positions[seen[:: max(1, len(seen) // most)]]


class Adjusted(NamedTuple):
    """Adjusted cameras in the input's frame, and the points that they triangulate.

    placed: views whose input pose was not begun with, placed by the points. carried:
    views that no track holds, moved along with their neighbours.
    """

    cameras: Cameras
    points: Points
    placed: list[int]
    carried: list[int]
    model: pycolmap.Reconstruction
    free: str = ""


def adjust(matches: Matches, given: Cameras, work, *, seed, free=""):
    """`Adjusted` cameras by all matches that are not held out.

    free: what of the lens is refined too: nothing, `focal` or, with distortion, `lens`.
    Writes into `work`. Raises TooFewError where too few tracks are left to adjust by.
    """
    work, lens = Path(work), free == "lens"
    work.mkdir(parents=True, exist_ok=True)
    wrong_px = calibration.errors_of_views(matches, given, held_out=False)
    usual_px = np.nanmedian(wrong_px) if np.isfinite(wrong_px).any() else np.inf
    astray = ~(wrong_px <= max(ASTRAY * usual_px, MIN_ASTRAY_PX))
    groups = groups_of(given, matches.width)
    near, _ = centred(given)
    state, placed = begun(one_lens_each(near, groups), groups, ~astray), []
    everything = model_of(
        matches, state._replace(posed=np.ones_like(astray)), lens=lens
    )
    few, every_match = (
        write_database(work / f"{name}.db", matches, everything, most)
        for name, most in (("few", MAX_MATCHES), ("every", np.inf))
    )
    every = turns_from(START * usual_px)
    pycolmap.set_random_seed(seed)
    triangulate_with = partial(triangulated, matches=matches, work=work, seed=seed)
    with progress.heartbeat("bundle adjustment"):
        for px in every:
            model = triangulate_with(few, state=state, px=px, lens=lens)
            if model.num_points3D() < MIN_TRACKS:
                raise TooFewError(f"{model.num_points3D()} tracks are too few")
            # Wrong poses bend a lens that is free before they are nearly right.
            is_near = px <= NEAR_PX
            own = free if is_near else ""
            refined = solve(model, state, free=own, near=is_near)
            state, new = with_more(matches, refined, model, px, seed)
            placed += new
        model = triangulate_with(
            every_match, state=state, px=LAST_PX, lens=lens, images=images_of(work)
        )
    return in_frame(model, matches, given, state.cameras)._replace(
        placed=placed, free=free
    )


def again(found: Adjusted, matches, given: Cameras, *, lens, seed, photo_px):
    """(`Adjusted` a second time, by keypoints evenly over each view; what is told).

    lens: whether the principal point may move too. photo_px: px of the photo in one of
    the matches.
    """
    model, told = readjustment.refine(
        found.model,
        free=found.free,
        more=("focal",) * (not found.free) + ("centre",) * lens,
        seed=seed,
        photo_px=photo_px,
    )
    if not told["accepted"]:
        return found, told
    try:
        now = in_frame(model, matches, given, cameras_of(model, found.cameras))
    except TooFewError as error:
        return found, readjustment.refused(told, str(error))
    return now._replace(placed=found.placed, free=told["refined"]), told


def in_frame(model, matches, given, now) -> Adjusted:
    """The cameras and the model, which changes, in the input's frame, and its points.

    Raises TooFewError where most views share no points.
    """
    points = points_of(model, matches)
    weak = [v for v, seen in enumerate(points.seen) if len(seen) < MIN_TRACKS]
    if len(weak) > len(matches.names) / 2:
        share = f"{len(weak)} of {len(matches.names)} views share no points"
        raise TooFewError(share)
    now, points, moved = in_frame_of(given, now, points, weak)
    move(model, moved)
    return Adjusted(now, points, [], weak, model)


def as_they_are(matches: Matches, now: Cameras, work, *, seed) -> Adjusted:
    """Cameras that stay, with the points that they see."""
    points, model = triangulate(matches, now, work, seed=seed)
    return Adjusted(now, points, [], [], model)


def anew(matches: Matches, given: Cameras, work, *, seed) -> Cameras:
    """Cameras that COLMAP finds from the matches and the given lens, without a pose.

    Their middle, extent and mean direction are the given ones'. Raises TooFewError
    naming views that it cannot place.
    """
    work = Path(work) / "anew"
    (work / "sparse").mkdir(parents=True, exist_ok=True)
    groups = groups_of(given, matches.width)
    near, (extent, _, middle) = centred(given)
    posed = begun(one_lens_each(near, groups), groups, np.ones(len(groups), bool))
    database = write_database(
        work / "matches.db", matches, model_of(matches, posed), MAX_MATCHES
    )
    pycolmap.set_random_seed(seed)
    options = mapping.pipeline_options(seed)
    # All photos or none: parts of them have no common frame.
    options.extract_colors, options.multiple_models = False, False
    options.init_num_trials = TRIALS
    with progress.heartbeat("COLMAP: new poses"):
        found = pycolmap.incremental_mapping(database, work, work / "sparse", options)
    best = max(found.values(), key=lambda one: one.num_reg_images(), default=None)
    there = (
        {image.image_id - 1 for image in best.images.values() if image.has_pose}
        if best
        else set()
    )
    if gone := [name for i, name in enumerate(matches.names) if i not in there]:
        raise TooFewError(f"COLMAP finds no poses of {faults.some_names(gone)}")
    now = cameras_of(best, posed.cameras)
    _, turn, _ = cameras.align_similarity(now.camtoworlds, near.camtoworlds)
    centres = now.camtoworlds[:, :, 3]
    own = np.abs(centres - centres.mean(axis=0)).max()
    scale = extent / max(own, 1e-12)
    shift = middle - scale * turn @ centres.mean(axis=0)
    poses = cameras.apply_similarity(now.camtoworlds, scale, turn, shift)
    return now._replace(camtoworlds=poses)


def images_of(work):
    """The photos of matches, beside `work`, for the colours of points; or None."""
    folder = work.parent / "matched"
    return folder if folder.is_dir() else None


def triangulate(matches: Matches, given: Cameras, work, *, seed):
    """(`Points`, COLMAP's model) that the given cameras triangulate as they are."""
    work = Path(work)
    work.mkdir(parents=True, exist_ok=True)
    lenses = given.camtopix[:, [0, 1, 0, 1], [0, 1, 2, 2]].round(9)
    _, groups = np.unique(lenses, axis=0, return_inverse=True)
    near, back = centred(given)
    state = begun(near, groups.ravel(), np.ones(len(groups), bool))
    database = write_database(work / "given.db", matches, model_of(matches, state))
    with progress.heartbeat("COLMAP: points"):
        model = triangulated(
            database,
            matches=matches,
            state=state,
            work=work,
            px=LAST_PX,
            seed=seed,
            images=images_of(work),
        )
    move(model, back)
    return points_of(model, matches), model


def centred(given: Cameras):
    """(cameras around the origin, of extent 1; the similarity that takes them back).

    COLMAP's solver knows no units: it gives up among millimetres, or far from 0.
    """
    poses, turn = given.camtoworlds, np.eye(3)
    middle = poses[:, :, 3].mean(axis=0)
    extent = float(np.abs(poses[:, :, 3] - middle).max())
    if cameras.is_one_place(poses):
        extent = 1.0
    poses = cameras.apply_similarity(poses, 1 / extent, turn, -middle / extent)
    return given._replace(camtoworlds=poses), (extent, turn, middle)


def turns_from(px):
    """Thresholds of the turns, in px: closing from one that the cameras need."""
    px, found = min(px, MAX_START_PX), []
    while px > NEAR_PX:
        found.append(px)
        px /= 2
    return [*found, NEAR_PX, LAST_PX]


class State(NamedTuple):
    """Cameras, the physical camera of each view, and which views have a pose.

    square: of each view, whether its camera has one focal length for both axes. It
    stays so whatever comes of it: COLMAP's database has one model of a camera.
    """

    cameras: Cameras
    groups: np.ndarray
    posed: np.ndarray
    square: np.ndarray


def begun(cameras, groups, posed):
    """The `State` of cameras that come in."""
    fx, fy = cameras.camtopix[:, 0, 0], cameras.camtopix[:, 1, 1]
    return State(cameras, groups, posed, np.abs(fx / fy - 1) < SQUARE)


def groups_of(given: Cameras, width):
    """[n] number of each view's physical camera: alike in lens, or nearly.

    Exports of phones have one set of intrinsics a frame; the lens is one.
    """
    lenses = given.camtopix[:, [0, 1, 0, 1], [0, 1, 2, 2]]
    scaled = np.concatenate(
        [np.log(lenses[:, :2]) / SAME_FOCAL, lenses[:, 2:] / (SAME_CENTRE * width)], 1
    )
    groups, leaders = np.zeros(len(lenses), int), []
    # The most usual lens first: others then differ from it, not it from them.
    order = np.argsort(np.abs(scaled - np.median(scaled, axis=0)).max(axis=1))
    for i in order:
        near = [k for k, lead in enumerate(leaders) if abs(scaled[i] - lead).max() < 1]
        groups[i] = near[0] if near else len(leaders)
        if not near:
            leaders.append(scaled[i])
    return groups


def one_lens_each(given: Cameras, groups) -> Cameras:
    """The cameras, the views of a group with their median lens."""
    lenses = given.camtopix.copy()
    for group in np.unique(groups):
        lenses[groups == group] = np.median(lenses[groups == group], axis=0)
    return given._replace(camtopix=lenses)


def write_database(path, matches: Matches, model, most=np.inf):
    """COLMAP's database of at most about `most` matches; view i is image i + 1.

    Those that are held out are not among them.
    """
    path.unlink(missing_ok=True)
    low, high = matches.used(most)
    of_given.write_views(path, model)
    with pycolmap.Database.open(path) as file:
        for number, xy in enumerate(matches.keypoints, start=1):
            file.write_keypoints(number, xy.astype(np.float32))
        for (i, j), index in zip(matches.pairs, matches.indices, strict=True):
            draws = matches.draws[i][index[:, 0]]
            index = index[(draws >= low) & (draws < high)].astype(np.uint32)
            if len(index):
                two_views = pycolmap.TwoViewGeometry()
                two_views.config = pycolmap.TwoViewGeometryConfiguration.UNCALIBRATED
                two_views.inlier_matches = index
                file.write_two_view_geometry(int(i) + 1, int(j) + 1, two_views)
    return path


def camera_of(state: State, view, size, number, *, lens):
    """A view's pycolmap.Camera: as few parameters as say what is there.

    lens: with distortion, also where that is 0 as yet.
    """
    camtopix, distortion = (
        getattr(state.cameras, k)[view] for k in ("camtopix", "distortion")
    )
    (fx, fy), (cx, cy) = camtopix[[0, 1], [0, 1]], camtopix[:2, 2]
    square, bent = bool(state.square[view]), lens or distortion.any()
    k1, k2, p1, p2, _ = distortion
    model, params = {
        (True, False): ("SIMPLE_PINHOLE", [fx, cx, cy]),
        (False, False): ("PINHOLE", [fx, fy, cx, cy]),
        (True, True): ("RADIAL", [fx, cx, cy, k1, k2]),
        (False, True): ("OPENCV", [fx, fy, cx, cy, k1, k2, p1, p2]),
    }[square, bool(bent)]
    width, height = size
    return pycolmap.Camera(
        model=model, params=params, width=width, height=height, camera_id=number
    )


def model_of(matches: Matches, state: State, *, lens=False):
    """COLMAP's model of the posed views, without points; ids as in the database."""
    model, size = pycolmap.Reconstruction(), (matches.width, matches.height)
    for group in np.unique(state.groups[state.posed]):
        first = int(np.flatnonzero(state.groups == group)[0])
        camera = camera_of(state, first, size, int(group) + 1, lens=lens)
        model.add_camera_with_trivial_rig(camera)
    for view in np.flatnonzero(state.posed):
        number, camera_id = int(view) + 1, int(state.groups[view]) + 1
        pose = state.cameras.camtoworlds[view]
        of_given.add_image(model, matches.names[view], number, camera_id, pose)
    return model


def triangulated(database, *, matches, state, work, px, seed, lens=False, images=None):
    """The model of the posed views with all points that they see within px."""
    options = mapping.pipeline_options(seed)
    options.triangulation.create_max_angle_error = max(2.0, 0.3 * px)
    options.triangulation.continue_max_angle_error = max(2.0, 0.3 * px)
    options.triangulation.complete_max_reproj_error = px
    options.triangulation.merge_max_reproj_error = px
    options.mapper.filter_max_reproj_error = px
    options.extract_colors = images is not None
    out = work / "sparse"
    out.mkdir(exist_ok=True)
    model = model_of(matches, state, lens=lens)
    pycolmap.set_random_seed(seed)
    return pycolmap.triangulate_points(
        model, database, images or work, out, options=options
    )


def solve(model, state: State, *, free, near) -> State:
    """The state after a bundle adjustment of the model, which changes."""
    # A principal point that is free hides in the poses.
    loss = (CAUCHY_PX, "CAUCHY") if near else (SOFT_PX, "SOFT_L1")
    options = adjustment.options_of(free, *loss)
    options.ceres.solver_options.function_tolerance = TOLERANCE
    adjustment.run(model, options)
    now = cameras_of(model, state.cameras)
    for group in np.unique(state.groups[state.posed]):
        # Views without a pose have the lens of their camera.
        own = state.groups == group
        first = np.flatnonzero(own & state.posed)[0]
        now.camtopix[own], now.distortion[own] = (
            now.camtopix[first],
            now.distortion[first],
        )
    return state._replace(cameras=now)


def cameras_of(model, before: Cameras) -> Cameras:
    """The cameras of a model whose image i + 1 is view i; others are as before."""
    lenses, poses, distortion = (
        getattr(before, key).copy() for key in ("camtopix", "camtoworlds", "distortion")
    )
    for image in model.images.values():
        if image.has_pose:
            view, camera = image.image_id - 1, model.cameras[image.camera_id]
            poses[view] = structure.pose_of(image)
            lenses[view], distortion[view] = structure.lens(
                camera.model.name, camera.params
            )
    return Cameras(lenses, poses, distortion)


def with_more(matches: Matches, state: State, model, px, seed):
    """(the state with views placed by the points that they see, their indices).

    px: within which a point is seen where it should be.
    """
    options = pycolmap.AbsolutePoseEstimationOptions()
    options.ransac.max_error, options.ransac.random_seed = px, seed
    points = {}
    for image in model.images.values():
        if image.has_pose:
            points[image.image_id - 1] = {
                k: model.points3D[p.point3D_id].xyz
                for k, p in enumerate(image.points2D)
                if p.has_point3D()
            }
    poses, posed, new = state.cameras.camtoworlds.copy(), state.posed.copy(), []
    for view in np.flatnonzero(~state.posed):
        xy, xyz = seen_by(matches, view, points)
        if len(xy) < MIN_TRACKS:
            continue
        size = matches.width, matches.height
        camera = camera_of(state, view, size, 1, lens=False)
        found = pycolmap.estimate_and_refine_absolute_pose(xy, xyz, camera, options)
        if found and found["num_inliers"] >= MIN_TRACKS:
            poses[view], posed[view] = (
                structure.pose_from(found["cam_from_world"]),
                True,
            )
            new.append(int(view))
    now = state.cameras._replace(camtoworlds=poses)
    return state._replace(cameras=now, posed=posed), new


def seen_by(matches: Matches, view, points):
    """(keypoints [k, 2] of a view, the points [k, 3] that matches say they show)."""
    xy, xyz = [], []
    for pair, index in zip(matches.pairs, matches.indices, strict=True):
        if view not in pair:
            continue
        at = list(pair).index(view)
        other = points.get(int(pair[1 - at]), {})
        for own, theirs in index[:, [at, 1 - at]]:
            if theirs in other:
                xy.append(matches.keypoints[view][own])
                xyz.append(other[theirs])
    return np.array(xy).reshape(-1, 2), np.array(xyz).reshape(-1, 3)


def points_of(model, matches: Matches) -> Points:
    """The points of a model whose image i + 1 is view i."""
    model.update_point_3d_errors()
    ids = {number: k for k, number in enumerate(model.points3D)}
    points = list(model.points3D.values())
    seen = [np.zeros(0, int)] * len(matches.names)
    errors = np.full(len(matches.names), np.nan)
    for image in model.images.values():
        if image.has_pose:
            view = image.image_id - 1
            seen[view] = np.array(
                [ids[p.point3D_id] for p in image.points2D if p.has_point3D()], int
            )
            errors[view] = structure.error_px(model, image)
    return Points(
        positions=np.array([point.xyz for point in points]).reshape(-1, 3),
        colours=np.array([point.color for point in points], np.uint8).reshape(-1, 3),
        seen=seen,
        reprojection_px=errors,
    )


def in_frame_of(given: Cameras, now: Cameras, points: Points, weak):
    """(cameras, points, the similarity): the adjusted ones in the input's frame.

    Weak views move as their nearest neighbour that is not.
    """
    strong = [v for v in range(len(points.seen)) if v not in set(weak)]
    found = pose_error.fit(given, now, {view: points.of_view(view) for view in strong})
    poses = cameras.apply_similarity(now.camtoworlds, *found)
    for view in weak:
        away = np.linalg.norm(
            given.camtoworlds[strong, :, 3] - given.camtoworlds[view, :, 3], axis=1
        )
        near = strong[int(np.argmin(away))]
        poses[view] = carried(
            given.camtoworlds[view], given.camtoworlds[near], poses[near]
        )
    scale, turn, shift = found
    return (
        now._replace(camtoworlds=poses),
        points._replace(positions=scale * points.positions @ turn.T + shift),
        found,
    )


def move(model, similarity_of):
    """Apply (scale, rotation, translation) to COLMAP's model, which changes."""
    scale, turn, shift = similarity_of
    model.transform(pycolmap.Sim3d(scale, pycolmap.Rotation3d(turn), shift))


def carried(pose, near, moved):
    """A pose [3, 4] moved in the world as its neighbour `near` has moved."""
    turn = moved[:, :3] @ near[:, :3].T
    centre = moved[:, 3] + turn @ (pose[:, 3] - near[:, 3])
    return np.concatenate([turn @ pose[:, :3], centre[:, None]], axis=1)
