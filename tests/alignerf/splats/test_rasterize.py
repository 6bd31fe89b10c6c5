"""Renders agree with the papers' formulas in float64, and are finite whatever is in."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

from alignerf.splats import ply, rasterize
from tests.alignerf.splats import reference

CAMERA = rasterize.Camera(np.eye(4)[:3], 60.0, 55.0, 31.0, 18.5, 61, 43)
ONE = np.ones(1, np.float32)


@pytest.fixture(scope="module", autouse=True)
def compiled():
    try:
        rasterize.library()
    except ValueError as error:
        pytest.skip(str(error))


def cloud(rng, count=120, degree=3):
    """Gaussians before the camera, thin ones and round ones, a few huge."""
    scales = np.exp(rng.uniform(-5, -1.5, (count, 3)))
    scales[:3] *= 20
    return ply.Gaussians(
        means=np.float32(rng.uniform([-2, -2, 0.3], [2, 2, 6], (count, 3))),
        scales=np.float32(scales),
        quaternions=ply.normalized(rng.normal(size=(count, 4))),
        opacities=np.float32(rng.uniform(0.02, 1, count)),
        sh=np.float32(rng.normal(0, 0.4, (count, (degree + 1) ** 2, 3))),
    )


def one(mean=(0, 0, 2), scale=(0.1, 0.1, 0.1), quaternion=(1, 0, 0, 0), **others):
    """A single white one."""
    return ply.Gaussians(
        means=np.float32([mean]),
        scales=np.float32([scale]),
        quaternions=np.float32([quaternion]),
        **{"opacities": ONE, "sh": np.full((1, 1, 3), 1.77, np.float32)} | others,
    )


def turned(rng):
    """A camera that looks at the cloud from aside."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    pose = np.concatenate([turn, turn @ [[0], [0], [-3]] + [[0], [0], [4]]], axis=1)
    return CAMERA._replace(world_to_camera=pose)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"antialiased": True, "dilation_px2": 0.1},
        {"near": 2.0, "max_alpha": 0.999, "background": (0.2, 0.5, 1)},
    ],
)
@pytest.mark.parametrize("degree", [0, 3])
def test_it_agrees_with_the_formulas(rng, options, degree):
    for camera in (CAMERA, turned(rng)):
        gaussians = cloud(rng, degree=degree)
        found = rasterize.render(gaussians, camera, **options)
        wanted = reference.render(gaussians, camera, **options)
        for image, true in zip(found, wanted, strict=True):
            assert image.dtype == np.float32
            apart = np.abs(image - true)
            # By rounding a pixel may take one Gaussian more, of 1/255, or one less.
            assert np.mean(apart) < 2e-5
            assert np.quantile(apart, 0.995) < 1e-4


def test_many_layers_are_laid_front_to_back(rng):
    """Until a pixel is opaque, as most are in a splat."""
    gaussians = cloud(rng, count=600)
    gaussians = dataclasses.replace(gaussians, scales=3 * gaussians.scales)
    found, wanted = (kind.render(gaussians, CAMERA) for kind in (rasterize, reference))
    assert np.mean(found.alpha > 0.99) > 0.9
    assert np.mean(np.abs(found.colour - wanted[0])) < 5e-5
    assert np.quantile(np.abs(found.depth - wanted[2]), 0.99) < 1e-3


def test_bits_do_not_depend_on_the_threads(rng):
    gaussians = cloud(rng, count=20_000)
    first, *others = (
        rasterize.render(gaussians, CAMERA, threads=threads) for threads in (1, 2, 7)
    )
    for other in others:
        for image, same in zip(first, other, strict=True):
            np.testing.assert_array_equal(image, same)


SMALL, HUGE = 1e-30, 1e30


@pytest.mark.parametrize(
    "gaussians",
    [
        one(scale=(0, 0, 0)),
        one(scale=(SMALL, SMALL, SMALL)),
        one(scale=(HUGE, HUGE, HUGE)),
        one(scale=(HUGE, SMALL, 0), quaternion=(1, 2, 3, 4)),
        one(scale=(np.inf, 1, 1)),
        one(quaternion=(0, 0, 0, 0)),
        one(quaternion=(HUGE, HUGE, 0, HUGE)),
        one(quaternion=(SMALL, 0, 0, 0)),
        one(mean=(0, 0, 0)),
        one(mean=(0, 0, -3)),
        one(mean=(0, 0, HUGE)),
        one(mean=(HUGE, -HUGE, 1)),
        one(mean=(1e8, 0, 1), scale=(1e8, 1, 1)),
        one(mean=(5, 5, 0.2001), scale=(HUGE, 1, 1)),
        one(mean=(np.nan, 0, 2)),
        one(scale=(np.nan, 1, 1)),
        one(opacities=np.float32([np.nan])),
        one(opacities=0 * ONE),
        one(sh=np.full((1, 16, 3), HUGE, np.float32)),
        one(sh=np.float32(3e38) * np.sign(np.sin(np.ones((1, 16, 3)).cumsum(1)))),
        one(sh=np.full((1, 4, 3), np.nan, np.float32)),
    ],
)
@pytest.mark.parametrize("antialiased", [False, True])
def test_whatever_a_gaussian_is_a_render_is_finite(gaussians, antialiased):
    for image in rasterize.render(gaussians, CAMERA, antialiased=antialiased):
        assert np.isfinite(image).all()
        assert (image >= 0).all()


def test_a_point_is_seen_as_its_dilation_unless_antialiased():
    gaussians = one(scale=(0, 0, 0))
    assert rasterize.render(gaussians, CAMERA).alpha.max() > 0.5
    assert rasterize.render(gaussians, CAMERA, antialiased=True).alpha.max() == 0


def test_a_wall_is_at_its_depth_and_nothing_is_the_background():
    wall = one(mean=(0, 0, 3), scale=(50, 50, 0))
    found = rasterize.render(wall, CAMERA, background=(1, 0, 0))
    np.testing.assert_allclose(found.alpha, 0.99, rtol=1e-3)
    np.testing.assert_allclose(found.depth, 3, rtol=1e-5)
    np.testing.assert_allclose(found.colour[..., 0], 1, rtol=1e-2)
    np.testing.assert_allclose(found.colour[..., 1], 0.99, rtol=1e-2)
    found = rasterize.render(one(mean=(0, 0, -3)), CAMERA, background=(1, 0, 0))
    assert (found.colour == [1, 0, 0]).all()
    assert not found.alpha.any()
    assert not found.depth.any()


def test_a_long_thin_gaussian_stays_one(rng):
    """A line through the picture whose centre is 40,000 px away."""
    along = np.array([np.cos(0.3), np.sin(0.3), 0])
    half = np.array([np.cos(0.15), 0, 0, np.sin(0.15)])
    line = one(mean=2000 * along + (0, 0, 3), scale=(1000, 0.01, 0.01), quaternion=half)
    found = rasterize.render(line, CAMERA)
    wanted = reference.render(line, CAMERA)
    assert wanted[1].max() > 0.1
    np.testing.assert_allclose(found.alpha, wanted[1], atol=0.02)


@pytest.mark.parametrize(
    "wrong",
    [
        {"width": 0},
        {"height": 10**6},
        {"fx": 0},
        {"fy": np.nan},
        {"cx": np.inf},
        {"world_to_camera": np.full((3, 4), np.nan)},
        {"world_to_camera": np.eye(3)},
    ],
)
def test_a_camera_that_is_none_is_refused(wrong):
    with pytest.raises(ValueError, match=r"pose|px|principal|focal"):
        rasterize.render(one(), CAMERA._replace(**wrong))


def test_arrays_of_other_gaussians_are_refused():
    gaussians = dataclasses.replace(one(), opacities=np.ones(2, np.float32))
    with pytest.raises(ValueError, match="same Gaussians"):
        rasterize.render(gaussians, CAMERA)


def test_without_a_compiler_one_line_says_so(monkeypatch, tmp_path):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("CXX", "no-such-compiler")
    monkeypatch.setattr(rasterize, "library", rasterize.library.__wrapped__)
    with pytest.raises(ValueError, match=r"compiled program: .*no-such-compiler"):
        rasterize.render(one(), CAMERA)


def test_importing_it_imports_no_jax():
    code = "import sys; from alignerf.splats import ply, rasterize; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert not {"jax", "flax", "snakemake"} & set(done.stdout.split())
