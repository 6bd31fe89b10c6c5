"""Poses optimized with the scene: rays move as cameras do, and gradients are right."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf import fields
from alignerf.cameras import refine
from alignerf.fields import grid, shading
from alignerf.methods.pose_optimization import PoseOptimization
from alignerf.mipnerf360 import coord
from alignerf.scenes import cameras, prepared
from alignerf.training import methods
from alignerf.training import step as train_step
from tests import job_cases, twins
from tests import training_cases as cases

SIZE = WIDTH, HEIGHT = 64, 48
COUNT = 5


@pytest.fixture
def views(rng):
    poses = np.zeros((COUNT, 3, 4))
    poses[:, :, :3] = Rotation.random(COUNT, rng=4).as_matrix()
    poses[:, :, 3] = 0.5 * rng.normal(size=(COUNT, 3))
    pixtocams = np.stack([cameras.intrinsics(55.0, *SIZE)] * COUNT)
    return refine.Views(pixtocams, poses, SIZE)


def random_twists(rng, size):
    return size * rng.normal(size=(COUNT, 6))


def rays_of(views, poses):
    x, y = np.array([3, 60, 31, 10, 50]), np.array([2, 40, 24, 44, 5])
    found = cameras.pixels_to_rays(x, y, views.pixtocams, poses)
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), found)


@pytest.mark.parametrize("size", [0.0, 1e-5, 0.01, 1.0])
def test_rays_move_as_their_cameras_do(rng, views, size):
    twist = random_twists(rng, size)
    given = rays_of(views, views.camtoworlds)
    found = jax.jit(refine.move)(given, jnp.asarray(twist, jnp.float32))
    wanted = rays_of(views, refine.moved_cameras(views.camtoworlds, twist))
    for ours, theirs in zip(*map(jax.tree.leaves, (found, wanted)), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=2e-6 * max(1, size))
    if size == 0.0:
        np.testing.assert_array_equal(found.directions, given.directions)


@pytest.mark.parametrize("size", [0.0, 1e-8, 1e-4, 0.5])
def test_the_gradient_of_a_turn_is_that_of_its_formula(rng, size):
    turn = size * rng.normal(size=(1, 3))
    vector = rng.normal(size=(1, 3)).astype("f4")

    def rotated(turn):
        return refine.rotated(jnp.asarray(vector), turn[None])[0]

    found = jax.jit(jax.jacrev(rotated))(jnp.asarray(turn[0], jnp.float32))
    step, wanted = 1e-5, np.zeros((3, 3))
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        ends = [Rotation.from_rotvec(turn[0] + s * shift) for s in (1, -1)]
        wanted[:, axis] = np.subtract(*(e.apply(vector[0]) for e in ends)) / (2 * step)
    np.testing.assert_allclose(found, wanted, atol=2e-4)


def test_pixels_move_as_the_jacobian_says(rng, views):
    points = rng.uniform(-1, 1, size=(7, 3)) + np.array([0, 0, 4])
    pixtocam, pose = views.pixtocams[0], views.camtoworlds[0]
    world = points @ cameras.OPENGL_FROM_OPENCV @ pose[:, :3].T + pose[:, 3]
    found = refine.pixel_jacobian(points, pixtocam, pose)
    step = 1e-6
    for axis in range(6):
        twist = step * np.eye(6)[axis : axis + 1]
        ends = [
            cameras.project(world, pixtocam, refine.moved_cameras(pose[None], t)[0])[0]
            for t in (twist, -twist)
        ]
        wanted = ((ends[0] - ends[1]) / (2 * step)).ravel()
        np.testing.assert_allclose(found[:, axis], wanted, rtol=1e-5, atol=1e-4)


def test_preconditioned_parameters_move_pixels_alike(views):
    scales = refine.scales_of(views, preconditioned=True)
    rng = np.random.default_rng(9)
    at = rng.uniform(size=(400, 2)) * SIZE
    rays = np.concatenate([at, np.ones((400, 1))], axis=-1) @ views.pixtocams[1].T
    points = rays / rng.uniform(1e-3, 2.5, size=(400, 1))
    jacobian = refine.pixel_jacobian(points, views.pixtocams[1], views.camtoworlds[1])
    spread = []
    for scale in (np.eye(6), scales[1]):
        square = (jacobian @ scale).T @ (jacobian @ scale)
        values = np.linalg.eigvalsh(square)
        spread.append(values[-1] / values[0])
    assert spread[1] < 5 < spread[0]
    # By one px at most, and not by much less where the padding counts.
    moved_px = np.sqrt(((jacobian @ scales[1]) ** 2).sum(axis=0) / 400)
    assert (moved_px < 1.1).all()
    assert (moved_px > 0.5).all()
    np.testing.assert_array_equal(refine.scales_of(views, False)[0], np.eye(6))


FIELDS = {
    "grid": {
        "levels": 2,
        "log2_hashmap_size": 12,
        "max_resolution": 16,
        "width": 8,
        "moving": True,
    },
    "mlp": {"width": 16, "depth": 2, "degrees": 3, "bottleneck": 8, "view_width": 8},
    "nerf": {"width": 16, "depth": 3, "skip_after": 1, "degrees": 2, "view_width": 8},
}


@pytest.mark.parametrize("kind", job_cases.one_of(FIELDS, "grid"))
def test_learning_turns_a_wrong_camera_towards_its_photo(kind):
    """Of the loss by a camera's twist, autodiff agrees with differences."""
    model = cases.tiny_model().clone(field=fields.make(kind, **FIELDS[kind]))
    method = methods.mipnerf360(model, batch_rays=96, loss_weights=cases.WEIGHTS)
    photos = cases.make_views(3)
    cameras_of = refine.Views(
        np.asarray(photos.pixtocams), np.asarray(photos.camtoworlds), (40, 24)
    )
    scales = refine.scales_of(cameras_of, preconditioned=False)
    learning = refine.refined(method, scales)
    params = jax.jit(learning.init)(jax.random.key(1))
    assert params["cameras"].shape == (3, 6)
    assert not np.any(params["cameras"])
    params["model"] = cases.varied(params["model"], 0.3)
    batch = jax.jit(learning.draw)(jax.random.key(2), 0, photos)

    @jax.jit
    def loss(twists):
        return learning.terms({**params, "cameras": twists}, batch, 1.0)[0]["data"]

    here = np.float32(0.003 * np.sin(np.arange(18)).reshape(3, 6))
    found = np.asarray(jax.jit(jax.grad(loss))(here))
    assert np.abs(found).max() > 1e-4
    direction = found / np.linalg.norm(found)
    steps = np.float32([1e-3, 2e-3])
    slopes = [
        float(loss(here + s * direction) - loss(here - s * direction)) / (2 * s)
        for s in steps
    ]
    assert np.mean(slopes) == pytest.approx(np.linalg.norm(found), rel=0.15)


def test_frequencies_come_in_one_after_the_other():
    count = 5
    weights = jax.jit(shading.fine_weights, static_argnums=1)
    first, last = (weights(jnp.float32(f), count) for f in (0, 1))
    np.testing.assert_allclose(first, [1, 0, 0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(last, np.ones(count), atol=1e-6)
    # BARF's Eq. 14 with alpha from 1 to L: in the middle two are whole, one is half.
    middle = weights(jnp.float32(3 / 8), count)
    np.testing.assert_allclose(middle, [1, 1, 0.5, 0, 0], atol=1e-6)
    passed = jax.jit(functools.partial(methods.passed, first=0.1, last=0.5))
    for share, wanted in ((0.0, 0.0), (0.1, 0.0), (0.3, 0.5), (0.5, 1.0), (1.0, 1.0)):
        assert float(passed(share)) == pytest.approx(wanted)


@pytest.mark.parametrize("kind", job_cases.one_of(FIELDS, "grid"))
def test_what_is_fine_is_hidden_at_first(kind):
    """A field's finest input changes its first colours not at all, its last ones do."""
    count = {"grid": 2, "mlp": 3, "nerf": 2}[kind]
    field = fields.make(kind, **FIELDS[kind])
    gaussians = some_gaussians()
    directions = jnp.asarray(np.full((2, 3), 3**-0.5), jnp.float32)
    params = jax.jit(field.init)(jax.random.key(0), gaussians, directions)
    params = cases.varied(params, 0.3)

    @jax.jit
    def values(params, fineness):
        return field.apply(params, gaussians, directions, fineness=fineness)[1]

    spoilt = without_the_finest(kind, params, count)
    for fineness, alike in ((0.0, True), (1.0, False)):
        before, after = values(params, fineness), values(spoilt, fineness)
        assert np.allclose(before, after, atol=1e-6) == alike
    whole = jax.jit(field.apply)(params, gaussians, directions)[1]
    np.testing.assert_allclose(values(params, 1.0), whole, atol=1e-6)


def some_gaussians():
    """Small ones on two rays of three samples."""
    mean = np.linspace(-0.7, 0.6, 18).reshape(2, 3, 3)
    direction = np.broadcast_to([0.0, 0.6, 0.8], mean.shape)
    std = np.full((2, 3), 1e-3)
    return coord.Gaussians(*twins.f32(mean, direction, std, std))


def without_the_finest(kind, params, count):
    """The parameters, those changed that only the finest level or frequency meets."""
    tree = jax.tree.map(np.array, params)
    if kind == "grid":
        levels = grid.Levels.geometric(2, 16, 16, 2**12)
        tree["params"]["table"][int(levels.offsets[-1]) :] += 1.0
        return tree
    # Inputs of the first layer: sines of all frequencies, then cosines; NeRF's has the
    # point before them.
    first = tree["params"]["Dense_0"]["kernel"]
    before = 3 * (kind == "nerf")
    half = (first.shape[1] - before) // 2
    part = half // count
    for start in (before, before + half):
        end = start + count * part
        first[:, end - part : end] += 1.0
    return tree


def test_cameras_wait_and_have_their_own_rates():
    chosen = PoseOptimization(learning_rates=[0.01, 0.001], delay_fraction=0.5)
    optimizer = train_step.make_optimizer(
        learning_rates=[0.1, 0.1],
        betas=[0.9, 0.99],
        eps=1e-15,
        cameras=chosen,
        steps=10,
        warmup_steps=0,
    )
    params = {"model": {"field": {"w": jnp.ones(2)}}, "cameras": jnp.zeros((2, 6))}
    state, lengths, update = optimizer.init(params), [], jax.jit(optimizer.update)
    for _ in range(10):
        grads = jax.tree.map(jnp.ones_like, params)
        updates, state = update(grads, state, params)
        lengths.append(float(np.abs(updates["cameras"]).max()))
        np.testing.assert_allclose(updates["model"]["field"]["w"], -0.1, rtol=1e-3)
    assert lengths[:5] == [0.0] * 5
    np.testing.assert_allclose(lengths[5], 0.01, rtol=1e-3)
    assert lengths[-1] < 0.002


def test_cameras_that_begin_late_begin_with_steps_of_their_rate():
    """Adam's means are corrected by the steps that had a gradient, not by all."""
    optimizer = train_step.make_optimizer(
        learning_rates=[0.1, 0.1],
        betas=[0.9, 0.99],
        eps=1e-15,
        cameras=PoseOptimization(learning_rates=[0.01, 0.01], delay_fraction=0.1),
        steps=1000,
        warmup_steps=0,
    )
    params = {"model": {"field": {"w": jnp.ones(2)}}, "cameras": jnp.zeros((2, 6))}
    grads = {**jax.tree.map(jnp.ones_like, params), "cameras": jnp.zeros((2, 6))}
    update, state = jax.jit(optimizer.update), optimizer.init(params)
    for _ in range(150):
        updates, state = update(grads, state, params)
        assert not np.any(updates["cameras"])
    updates, state = update(jax.tree.map(jnp.ones_like, params), state, params)
    np.testing.assert_allclose(updates["cameras"], -0.01, rtol=1e-3)


def test_other_views_come_along_with_the_frame(rng, tmp_path, views):
    scene = prepared.Scene(
        folder=tmp_path,
        names=list("abcde"),
        split=np.array(["test", *["train"] * 4]),
        pixtocams=views.pixtocams,
        camtoworlds=views.camtoworlds,
        width=WIDTH,
        height=HEIGHT,
    )
    shift = np.tile([0, 0, 0, 0.1, -0.2, 0.3], (4, 1))
    scales = np.broadcast_to(np.eye(6), (4, 6, 6))
    found = refine.learnt(scene, jnp.asarray(shift, jnp.float32), scales)
    wanted = scene.camtoworlds.copy()
    wanted[:, :, 3] += np.array([0.1, -0.2, 0.3])
    np.testing.assert_allclose(found.camtoworlds, wanted, atol=1e-6)
    still = refine.learnt(scene, jnp.zeros((4, 6)), scales)
    np.testing.assert_array_equal(still.camtoworlds, scene.camtoworlds)


def test_a_common_turn_that_steps_hide_moves_no_other_view(rng, tmp_path):
    """Through a long lens all cameras turn, and step back: the picture stays.

    A held-out camera has to see the scene where it was.
    """
    count, depth, turn, focal_px = 9, 10.0, 0.004, 2000.0
    poses = np.repeat(np.eye(4)[None, :3], count, axis=0)
    poses[:, :, 3] = rng.uniform(-1, 1, size=(count, 3)) * [1, 1, 0.1]
    scene = prepared.Scene(
        folder=tmp_path,
        names=list("abcdefghi"),
        split=np.array(["test", *["train"] * (count - 1)]),
        pixtocams=np.stack([cameras.intrinsics(focal_px, WIDTH, HEIGHT)] * count),
        camtoworlds=poses,
        width=WIDTH,
        height=HEIGHT,
    )
    turns = turn * (1 + 0.3 * rng.normal(size=count - 1))
    twist = np.zeros((count - 1, 6))
    twist[:, 1], twist[:, 3] = turns, turns * depth
    scales = np.broadcast_to(np.eye(6), (count - 1, 6, 6))
    found = refine.learnt(scene, jnp.asarray(twist, jnp.float32), scales)
    place = poses[0, :, 3] + [[0, 0, -depth]]
    for view in range(count):
        before, now = (
            cameras.project(place, one.pixtocams[view], one.camtoworlds[view])[0]
            for one in (scene, found)
        )
        assert np.linalg.norm(now - before) < 0.05 * turn * focal_px
