"""Facts of a scene: geometry by constructions whose answer is known."""

import json

import numpy as np
import pytest

from alignerf import facts
from alignerf.courtyard import scene as courtyard
from alignerf.scenes import cameras, prepared


def ring(count, radius=2.0):
    """Cameras on a circle that look at the origin."""
    angles = 2 * np.pi * np.arange(count) / count
    places = radius * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    return np.stack([courtyard.look_at(place, np.zeros(3)) for place in places])


@pytest.fixture
def scene(tmp_path):
    """A ring of eight cameras at distance 2."""
    (tmp_path / "images").mkdir()
    np.savez(
        tmp_path / "cameras.npz",
        pixtocams=np.stack([cameras.intrinsics(60.0, 64, 48)] * 8),
        camtoworlds=ring(8),
        names=[f"v{i}" for i in range(8)],
        width=64,
        height=48,
        split=np.array(["test"] + ["train"] * 7),
    )
    return tmp_path


def facts_of(scene):
    outs = [f"--{name}={scene / name}.json" for name in ("facts", "decisions")]
    facts.main(["--scene", str(scene), *outs])
    return json.loads((scene / "facts.json").read_text())


def test_points_say_how_near_a_scene_is(scene, rng):
    points = rng.uniform(-0.05, 0.05, size=(200, 3))
    np.savez(
        scene / prepared.POINTS, points=points, colours=np.zeros_like(points, "u1")
    )
    found = facts_of(scene)
    # Cameras at distance 2 have a largest coordinate of 2: lengths are half of these.
    assert found["median_depth"] == pytest.approx(1.0, abs=0.05)
    assert found["nearest"] == pytest.approx(0.97, abs=0.05)
    assert (found["width_px"], found["height_px"], found["views"]) == (64, 48, 8)
    assert found["pixel_angle_mrad"] == pytest.approx(1e3 / 60, abs=1e-3)


def test_without_points_and_report_what_is_not_known_is_null(scene):
    found = facts_of(scene)
    for key in ("nearest", "median_depth", "photo_width_px", "downscale"):
        assert found[key] is None


def test_bounds_that_are_no_depths_are_no_facts(scene):
    unknown = [[0, 5], [-1, 5], [np.nan, 5], [5, 2]]
    np.savez(scene / prepared.BOUNDS, bounds=unknown)
    assert facts_of(scene)["nearest"] is None
    np.savez(scene / prepared.BOUNDS, bounds=[*unknown, [1.0, np.inf], [2.0, 6.0]])
    found = facts_of(scene)
    # Lengths are half of these, see above; 3 is the harmonic mean.
    depths = [found[name] for name in ("nearest", "median_depth")]
    np.testing.assert_allclose(depths, [1.0, 1.5], rtol=0.03)
    # Points that were triangulated later say no more than a format's own depths.
    np.savez(scene / prepared.POINTS, points=np.zeros((4, 3)), colours=np.zeros((4, 3)))
    assert facts_of(scene) == found
