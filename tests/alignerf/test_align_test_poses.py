"""Test cameras moved to fit their photos: the stage, on a sphere seen from within."""

import csv
import types

import cv2
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf import align_test_poses, evaluate
from alignerf.io import faults, images
from alignerf.metrics import image as image_metrics
from alignerf.scenes import cameras, prepared
from alignerf.training import methods, renderer
from flow.camera import fit as camera_fit
from flow.estimation import estimate
from flow.warping import controls, files
from tests import camera_twins

WIDTH, HEIGHT, FOCAL_PX = 66, 48, 55.0
RADIUS = 2.5
NAMES = ["v0", "v1", "v2", "v3"]
EVERYWHERE = np.ones((HEIGHT, WIDTH), bool)


def seen(rays):
    """(colours [n, 3], depth [n]) of a painted sphere around all cameras."""
    origins, directions = rays.origins, rays.directions
    a, b, c = (
        jnp.sum(first * second, axis=-1)
        for first, second in (
            (directions, directions),
            (origins, directions),
            (origins, origins),
        )
    )
    depth = (-b + jnp.sqrt(b**2 - a * (c - RADIUS**2))) / a
    points = origins + depth[:, None] * directions
    waves = jnp.sin(points[:, None] * jnp.array([[[3.0], [5.0], [9.0]]]) + 0.4)
    return 0.5 + 0.16 * jnp.sum(waves, axis=1), depth


def painted(halo=0):
    """The sphere as a method; with a halo, each colour is a mean of 3x3 values."""

    def render(params, rays):
        values, depth = seen(rays)
        return types.SimpleNamespace(values=values, depth=depth)

    def colours(params, values):
        if not halo:
            return values
        h, w = values.shape[0] - 2, values.shape[1] - 2
        parts = [values[i : i + h, j : j + w] for i in range(3) for j in range(3)]
        return sum(parts) / 9

    return methods.Method(1, lambda key: {}, None, None, render, colours, halo)


BOTH = pytest.mark.parametrize("halo", [0, 1], ids=["rays", "patches"])


@pytest.fixture
def halo():
    return 0


@pytest.fixture
def method(halo, monkeypatch):
    found = painted(halo)
    monkeypatch.setattr(renderer, "read_model", lambda *_, **__: (found, {}))
    return found


@pytest.fixture
def scene(tmp_path, rng, method):
    """Test views by wrong cameras, photos by the true ones, and the flow to them."""
    turns = Rotation.from_rotvec(0.2 * rng.normal(size=(4, 3))).as_matrix()
    poses = np.concatenate([turns, rng.normal(size=(4, 3, 1))], axis=-1)
    pixtocams = np.stack([cameras.intrinsics(FOCAL_PX, WIDTH, HEIGHT)] * 4)
    arrays = {"pixtocams": pixtocams, "camtoworlds": poses, "names": np.array(NAMES)}
    sizes = {"width": WIDTH, "height": HEIGHT, "split": np.array(["test"] * 4)}
    np.savez(tmp_path / "cameras.npz", **arrays, **sizes)
    for kind in ("flow", "no_flow", "depth"):
        (tmp_path / kind).mkdir()
    loaded = prepared.load(tmp_path)
    render = renderer.make_renderer(method, {}, WIDTH, HEIGHT)
    for view, name in enumerate(NAMES):
        camera = loaded.pixtocams[view], loaded.camtoworlds[view]
        true = camera[1].copy()
        true[:, :3] = (
            true[:, :3] @ Rotation.from_rotvec([0.02, -0.015, 0.01]).as_matrix()
        )
        true[:, 3] += [0.02, -0.03, 0.01]
        image, depth = render(*camera)
        for folder in ("renders", "truth/oracle"):
            images.write(tmp_path / folder / f"{name}.png", image)
        images.write(tmp_path / "images" / f"{name}.png", render(camera[0], true)[0])
        flow_px = camera_twins.reprojection_flow(depth, camera, (camera[0], true))
        flow_px = flow_px.astype(np.float32)
        for kind, found in (("flow", flow_px), ("no_flow", 0 * flow_px)):
            files.write_flow(tmp_path / kind / f"{name}.npz", found, EVERYWHERE)
        np.savez(tmp_path / "depth" / f"{name}.npz", depth=depth)
    return tmp_path


def run(scene, *more, out="moved"):
    return faults.exit_code(
        align_test_poses.main,
        [
            *("--config", "{}", "--model", "none", "--scene", str(scene)),
            *("--renders", str(scene / "renders"), "--depth", str(scene / "depth")),
            *("--flow", str(scene / "flow"), "--truth", str(scene / "truth")),
            *("--out", str(scene / out), *more),
        ],
    )


def psnr_db(scene, first, second):
    """Mean over views of two folders' images."""
    pairs = [
        [images.read(scene / f / f"{v}.png") for f in (first, second)] for v in NAMES
    ]
    return np.mean([image_metrics.psnr_db(*pair, EVERYWHERE) for pair in pairs])


@BOTH
def test_moved_cameras_render_what_the_photos_show(scene):
    assert run(scene, "--truth-flow", str(scene / "no_flow")) == 0
    assert psnr_db(scene, "images", "truth/oracle") < 27
    assert psnr_db(scene, "images", "moved/aligned_pose") > 45
    # Where no camera needs to move, none does.
    for name in NAMES:
        pair = [
            scene / d / f"{name}.png"
            for d in ("truth/oracle", "moved/aligned_pose_overfit")
        ]
        np.testing.assert_array_equal(*map(images.read, pair))
    with open(scene / "moved" / "poses.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 2 * 4
    lengths = {row["test_set"]: float(row["length_px"]) for row in rows}
    assert lengths["aligned_pose"] > 1
    assert lengths["aligned_pose_overfit"] == pytest.approx(0, abs=1e-9)
    # What can be seen so well is scored.
    assert max(float(row["error_px"]) for row in rows) < evaluate.MAX_ERROR_PX


@BOTH
def test_no_pixel_is_rendered_by_what_it_shows(scene):
    """Spoilt flows of one half change the renders of the other alone."""
    half = controls.checkerboard(
        HEIGHT, WIDTH, block_px=HEIGHT // align_test_poses.SQUARES
    )
    assert run(scene, out="before") == 0
    for name in NAMES:
        path = scene / "flow" / f"{name}.npz"
        flow_px, valid = files.read_flow(path)
        files.write_flow(path, np.where(half[..., None], 3 * flow_px, flow_px), valid)
    assert run(scene, out="after") == 0
    for name in NAMES:
        before, after = (
            images.read(scene / out / "aligned_pose" / f"{name}.png")
            for out in ("before", "after")
        )
        np.testing.assert_array_equal(before[half], after[half])
        assert (before[~half] != after[~half]).any()


@pytest.mark.parametrize("estimator", ["deepflow", "dis_fine"])
def test_an_estimated_flow_carries_little_into_the_other_half(method, rng, estimator):
    """One half of a photo shifts by 3 px: the camera that the other half asks for."""
    width, height = 200, 150
    x, y = np.meshgrid(np.arange(width + 8.0), np.arange(height))
    waves = [np.sin(f * x + g * y) for f, g in ((0.31, 0.1), (0.12, 0.4), (0.7, 0.55))]
    noise = cv2.GaussianBlur(rng.normal(size=x.shape), (0, 0), 1.5)
    texture = 128 + 30 * sum(waves) + 60 * noise
    render, photo, other = (
        np.repeat(texture[:, s : s + width, None], 3, axis=2).clip(0, 255).astype("u1")
        for s in (2, 1, 4)
    )
    block_px = height // align_test_poses.SQUARES
    half = controls.checkerboard(height, width, block_px=block_px)
    margin_px = int(align_test_poses.MARGIN * block_px)
    fitted = align_test_poses.within(half, margin_px)
    pixtocam = cameras.intrinsics(170.0, width, height)
    lengths_px = []
    for shown in (photo, np.where(half[..., None], photo, other)):
        flow_px = estimate.estimate(render, shown, method=estimator)
        found = camera_fit.split(flow_px, fitted, pixtocam, log_focal=0.0)
        lengths_px.append(np.median(np.linalg.norm(found.camera_px, axis=-1)))
    assert lengths_px[0] == pytest.approx(1, abs=0.1)
    # 0.11 px by deepflow, less by DIS.
    assert lengths_px[1] == pytest.approx(lengths_px[0], abs=0.15)


@BOTH
def test_wanted_pixels_are_those_of_the_whole_render(method, rng):
    render = renderer.make_renderer(method, {}, WIDTH, HEIGHT)
    camera = cameras.intrinsics(FOCAL_PX, WIDTH, HEIGHT), np.eye(4)[:3]
    whole, depth = render(*camera)
    for wanted in (rng.uniform(size=(HEIGHT, WIDTH)) < 0.1, EVERYWHERE & (depth > 3)):
        wanted[0, 0] = wanted[-1, -1] = True
        found, found_depth = render(*camera, wanted)
        np.testing.assert_array_equal(found[wanted], whole[wanted])
        np.testing.assert_array_equal(found_depth[wanted], depth[wanted])
    assert not any(map(np.any, render(*camera, ~EVERYWHERE)))


@pytest.mark.parametrize(
    ("break_it", "reason"),
    [
        (lambda s: (s / "flow" / "v1.npz").unlink(), "flow/v1.npz"),
        (lambda s: (s / "depth" / "v2.npz").write_bytes(b"PK"), "depth/v2.npz"),
        (
            lambda s: files.write_flow(
                s / "flow" / "v1.npz",
                np.zeros((4, 4, 2), np.float32),
                EVERYWHERE[:4, :4],
            ),
            "v1.npz: (4, 4) is not the views' size",
        ),
    ],
)
def test_bad_files_are_named_and_nothing_is_written(scene, capsys, break_it, reason):
    break_it(scene)
    assert run(scene) == 1
    assert reason in capsys.readouterr().err.splitlines()[-1]
    assert not (scene / "moved").exists()


def test_a_flow_that_says_nothing_leaves_the_camera(scene):
    for path in (scene / "flow").iterdir():
        flow_px, valid = files.read_flow(path)
        files.write_flow(path, flow_px, valid & False)
    assert run(scene) == 0
    assert psnr_db(scene, "truth/oracle", "moved/aligned_pose") == np.inf
    errors_px = evaluate.errors_of(scene / "moved")
    assert errors_px == {(name, "aligned_pose"): np.inf for name in NAMES}
