"""Facts of a scene: geometry by constructions whose answer is known."""

import json

import numpy as np
import pytest
from PIL import Image

from alignerf import facts
from alignerf.scenes import cameras, prepared


def ring(count, radius=2.0):
    """Cameras on a circle that look at the origin."""
    poses = []
    for angle in 2 * np.pi * np.arange(count) / count:
        back = np.array([np.cos(angle), np.sin(angle), 0.0])
        right = np.array([-np.sin(angle), np.cos(angle), 0.0])
        up = np.cross(back, right)
        poses.append(np.stack([right, up, back, radius * back], axis=1))
    return np.stack(poses)


def test_cameras_on_a_ring_focus_on_its_centre():
    assert facts.focus_distance(ring(7, radius=2.0)) == pytest.approx(2.0, abs=1e-4)


def test_parallel_or_single_cameras_have_no_focus():
    one = ring(1)
    assert facts.focus_distance(one) is None
    moved = one.copy()
    moved[0, 1, 3] += 1
    assert facts.focus_distance(np.concatenate([one, moved])) is None


@pytest.mark.parametrize("count", [1, 9])
def test_the_file_is_json_with_true_sizes(tmp_path, count, rng):
    (tmp_path / "images").mkdir()
    names = [f"v{i}" for i in range(count)]
    for name in names:
        image = rng.integers(0, 255, (12, 16, 3), dtype=np.uint8)
        Image.fromarray(image).save(tmp_path / "images" / f"{name}.png")
    split = np.array(["train", "test"])[np.arange(count) % 2]
    np.savez(
        tmp_path / "cameras.npz",
        pixtocams=np.stack([cameras.intrinsics(20.0, 16, 12)] * count),
        camtoworlds=ring(count),
        names=names,
        width=16,
        height=12,
        split=split,
    )
    if count == 1:
        with pytest.raises(ValueError, match="no test view"):
            facts_of(tmp_path)
        assert not (tmp_path / "facts.json").exists()
        return
    found = facts_of(tmp_path)
    assert (found["width_px"], found["height_px"], found["views"]) == (16, 12, 9)
    assert found["focal_px"] == pytest.approx(20.0, abs=1e-3)
    assert found["photo_bytes"] == 9 * 12 * 16 * 3


def test_how_the_cameras_stand_is_named():
    inward, outward = ring(8), ring(8)
    # The same places, turned about the vertical: right and back change sign.
    outward[:, :, [0, 2]] *= -1
    agreement = np.linalg.norm(inward[:, :, 2].mean(axis=0))
    assert facts.capture_of(inward, agreement) == "inward"
    assert facts.capture_of(outward, agreement) == "outward"
    assert facts.capture_of(inward, 0.95) == "forward-facing"
    assert facts.capture_of(ring(1), 0.5) == "one view"


@pytest.mark.parametrize("count", [2, 5, 24])
def test_neighbours_on_a_ring_are_a_share_of_it_apart(count):
    found = facts.neighbour_angle_deg(ring(count))
    assert found == pytest.approx(360 / count, abs=0.01)
    assert facts.neighbour_angle_deg(ring(1)) is None


@pytest.fixture
def scene(tmp_path, rng):
    """A ring of eight cameras at distance 2, of photos of noise."""
    (tmp_path / "images").mkdir()
    names = [f"v{i}" for i in range(8)]
    for name in names:
        image = rng.integers(0, 255, (48, 64, 3), dtype=np.uint8)
        Image.fromarray(image).save(tmp_path / "images" / f"{name}.png")
    np.savez(
        tmp_path / "cameras.npz",
        pixtocams=np.stack([cameras.intrinsics(60.0, 64, 48)] * 8),
        camtoworlds=ring(8),
        names=names,
        width=64,
        height=48,
        split=np.array(["test"] + ["train"] * 7),
    )
    return tmp_path


def facts_of(scene):
    outs = [f"--{name}={scene / name}.json" for name in ("facts", "decisions")]
    facts.main(["--scene", str(scene), *outs])
    return json.loads((scene / "facts.json").read_text())


@pytest.mark.parametrize(("far", "bounded"), [(0.0, True), (40.0, False)])
def test_points_say_how_near_and_far_a_scene_is(scene, rng, far, bounded):
    points = rng.uniform(-0.05, 0.05, size=(200, 3))
    if far:
        # A tenth of them a long way behind what the cameras look at.
        angles = rng.uniform(0, 2 * np.pi, size=40)
        ends = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
        points = np.concatenate([points, far * ends])
    np.savez(
        scene / prepared.POINTS, points=points, colours=np.zeros_like(points, "u1")
    )
    found = facts_of(scene)
    # Cameras at distance 2 have a largest coordinate of 2: lengths are half of these.
    assert found["median_depth"] == pytest.approx(1.0, abs=0.05)
    assert found["nearest"] == pytest.approx(0.97, abs=0.05)
    assert found["bounded"] is bounded


def test_without_points_and_report_what_is_not_known_is_null(scene):
    found = facts_of(scene)
    for key in ("nearest", "farthest", "bounded", "reprojection_px"):
        assert found[key] is None


def test_errors_are_in_pixels_of_the_training(scene):
    report = {
        "mean_reprojection_error_px": 0.8,
        "width": 64,
        "photo_width": 256,
        "registered": 8,
        "total": 10,
        "points_in_3_views": 0.5,
    }
    (scene / "poses.json").write_text(json.dumps(report))
    found = facts_of(scene)
    assert found["reprojection_px"] == pytest.approx(0.2)
    assert found["registered_fraction"] == 0.8


def test_soft_and_dark_photos_are_found(scene, rng):
    path = scene / "images" / "v3.png"
    soft = Image.open(path).resize((8, 6)).resize((64, 48), Image.BILINEAR)
    soft.save(path)
    assert facts_of(scene)["soft_photos"] == ["v3"]
    assert facts_of(scene)["brightness_spread_ev"] < 0.1
    dark = (np.asarray(Image.open(scene / "images" / "v5.png")) // 4).astype(np.uint8)
    Image.fromarray(dark).save(scene / "images" / "v5.png")
    assert facts_of(scene)["brightness_spread_ev"] > 0.5


def test_bounds_that_are_no_depths_are_no_facts(scene):
    unknown = [[0, 5], [-1, 5], [np.nan, 5], [5, 2]]
    np.savez(scene / prepared.BOUNDS, bounds=unknown)
    assert facts_of(scene)["nearest"] is None
    np.savez(scene / prepared.BOUNDS, bounds=[*unknown, [1.0, np.inf], [2.0, 6.0]])
    found = facts_of(scene)
    # Lengths are half of these, see above; 3 is the harmonic mean.
    names = ("nearest", "median_depth", "farthest")
    np.testing.assert_allclose([found[n] for n in names], [1.0, 1.5, 3.0], rtol=0.03)
    # Points that were triangulated later say no more than a format's own depths.
    np.savez(scene / prepared.POINTS, points=np.zeros((4, 3)), colours=np.zeros((4, 3)))
    assert facts_of(scene)["farthest"] == found["farthest"]
