"""Depth of another program's renders: its files, its kind, its unit."""

import gzip
import io

import cv2
import numpy as np
import pytest
from PIL import Image

from alignerf.scenes import cameras
from alignerf.scenes.judged import depths

SIZE = (96, 64)
PIXTOCAM = np.linalg.inv(np.array([[60.0, 0, 48], [0, 60.0, 32], [0, 0, 1]]))
POSE = np.eye(4)[:3]


def surface():
    """A slanted, waved surface: its depth [h, w]."""
    y, x = np.indices(SIZE[::-1])
    return (3 + 0.01 * x + 0.5 * np.sin(y / 9)).astype(np.float32)


def distances(depth):
    """What a program writes that measures along the rays."""
    y, x = np.indices(depth.shape) + 0.5
    rays = np.stack([x, y, np.ones_like(x)], -1) @ PIXTOCAM.T
    return depth * np.linalg.norm(rays, axis=-1)


def points_of(depth, count=400):
    """Points on the surface, in the world."""
    rng = np.random.default_rng(0)
    column, row = rng.integers(0, SIZE[0], count), rng.integers(0, SIZE[1], count)
    at = np.stack([column + 0.5, row + 0.5, np.ones(count)], -1)
    rays = at @ PIXTOCAM.T * depth[row, column][:, None]
    return rays * [1, -1, -1]


def save(path, values):
    if path.suffix == ".npz":
        np.savez(path, depth=values)
    elif path.suffix == ".npy":
        np.save(path, values[..., None])
    elif path.suffix == ".gz":
        buffer = io.BytesIO()
        np.save(buffer, values[..., None])
        path.write_bytes(gzip.compress(buffer.getvalue()))
    elif path.suffix == ".png":
        Image.fromarray(np.round(1000 * values).astype(np.uint16)).save(path)
    else:
        cv2.imwrite(str(path), values)


@pytest.mark.parametrize("suffix", [".npz", ".npy", ".npy.gz", ".png", ".tiff"])
@pytest.mark.parametrize("kind", depths.KINDS)
def test_the_points_tell_kind_and_unit(tmp_path, suffix, kind):
    """Written in another unit, along the axis or along the ray, depth comes back."""
    depth = surface()
    values = depth if kind == "depth" else distances(depth)
    save(tmp_path / f"a{suffix}", 2.5 * values.astype(np.float32))
    found = depths.find(tmp_path, ["a", "b"])
    assert list(found) == ["a"]
    of_views = {"a": (PIXTOCAM, POSE, SIZE, None)}
    unit = depths.unit_of(found, of_views, points_of(depth))
    assert unit.kind == kind
    along = depths.along_axis(depths.read(found["a"]), unit.kind, PIXTOCAM)
    np.testing.assert_allclose(unit.scale * along, depth, rtol=2e-3)


def test_without_points_numbers_stay(tmp_path):
    save(tmp_path / "a.npy", surface())
    found = depths.find(tmp_path, ["a"])
    unit = depths.unit_of(found, {"a": (PIXTOCAM, POSE, SIZE, None)}, None)
    assert unit.kind == "depth"
    assert unit.scale == 1
    assert np.isnan(unit.spread)
    few = points_of(surface(), 10)
    assert depths.unit_of(found, {"a": (PIXTOCAM, POSE, SIZE, None)}, few).scale == 1


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.npy", b"\x93NUMPY", "not a readable depth"),
        ("a.npz", b"PK", "not a readable depth"),
        ("a.npy.gz", b"\x1f\x8bx", "not a readable depth"),
        ("a.png", b"no", "not a readable depth"),
        ("a.tiff", b"no", "not a readable depth"),
    ],
)
def test_broken_files_are_named(tmp_path, name, content, says):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=rf"{name}: {says}"):
        depths.read(tmp_path / name)


def test_a_picture_is_no_depth(tmp_path):
    """Eight bits, or colours, or a list of objects."""
    Image.fromarray(np.zeros((4, 4), np.uint8)).save(tmp_path / "a.png")
    with pytest.raises(ValueError, match="16 bits and one channel"):
        depths.read(tmp_path / "a.png")
    np.save(tmp_path / "a.npy", np.zeros((4, 4, 3)))
    with pytest.raises(ValueError, match="is no depth"):
        depths.read(tmp_path / "a.npy")
    np.save(tmp_path / "b.npy", np.array([{}]), allow_pickle=True)
    with pytest.raises(ValueError, match="not a readable depth"):
        depths.read(tmp_path / "b.npy")


def test_exr_is_refused_in_one_line(tmp_path):
    (tmp_path / "a.exr").write_bytes(b"")
    with pytest.raises(ValueError, match=r"EXR is not read here: write \.npy"):
        depths.find(tmp_path, ["a"])


def test_none_there(tmp_path):
    with pytest.raises(ValueError, match="no folder of depths"):
        depths.find(tmp_path / "gone", ["a"])
    with pytest.raises(ValueError, match="no depths"):
        depths.find(tmp_path, ["a"])


def test_coarse_depth_of_points():
    """Between points it is near that of the surface; hidden points do not count."""
    depth = surface()
    points = points_of(depth)
    behind = points_of(3 * depth, 100)
    found = depths.of_points(np.concatenate([points, behind]), PIXTOCAM, POSE, SIZE)
    assert np.abs(found / depth - 1).mean() < 0.1
    assert np.isinf(depths.of_points(points[:20], PIXTOCAM, POSE, SIZE)).all()


def test_points_are_seen_where_they_are():
    depth = surface()
    column, row, found = depths.visible(points_of(depth), PIXTOCAM, POSE, SIZE)
    np.testing.assert_allclose(found, depth[row, column], rtol=1e-5)
    at, _ = cameras.project(points_of(depth)[:1], PIXTOCAM, POSE)
    assert 0 <= at[0, 0] < SIZE[0]


def test_depths_beside_renders(tmp_path):
    """As ns-render writes both: pictures of depth are none, nor are other depths."""
    for split, name in (("train", "a"), ("test", "b")):
        for kind in ("rgb", "depth", "raw-depth", "raw-expected_depth"):
            folder = tmp_path / split / kind
            folder.mkdir(parents=True)
            suffix = ".npy.gz" if kind.startswith("raw") else ".png"
            save(folder / f"{name}{suffix}", surface())
    found = depths.find(tmp_path, ["a", "b"])
    assert sorted(found) == ["a", "b"]
    assert {path.parent.name for path in found.values()} == {"raw-depth"}
