"""Facts of a scene: geometry by constructions whose answer is known."""

import json

import numpy as np
import pytest
from PIL import Image

from alignerf import facts
from alignerf.scenes import cameras


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
    arguments = ["--scene", str(tmp_path), "--facts", str(tmp_path / "facts.json")]
    if count == 1:
        with pytest.raises(ValueError, match="no test view"):
            facts.main(arguments)
        assert not (tmp_path / "facts.json").exists()
        return
    facts.main(arguments)
    found = json.loads((tmp_path / "facts.json").read_text())
    assert (found["width_px"], found["height_px"], found["views"]) == (16, 12, 9)
    assert found["focal_px"] == pytest.approx(20.0, abs=1e-3)
    assert found["photo_bytes"] == 9 * 12 * 16 * 3
