"""Depth of another program's renders: its files, its kind, its unit."""

import gzip
import io
import os
import resource
import struct
import zipfile
import zlib

import cv2
import numpy as np
import pytest
from PIL import Image

from alignerf.scenes import cameras
from alignerf.scenes.external import depths

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


def npy(values):
    """The bytes of an .npy."""
    buffer = io.BytesIO()
    np.save(buffer, values, allow_pickle=True)
    return buffer.getvalue()


def head(shape, kind="<f4"):
    """The bytes of an .npy whose values are left out."""
    buffer, content = io.BytesIO(), {"descr": kind, "fortran_order": False}
    np.lib.format.write_array_header_1_0(buffer, content | {"shape": shape})
    return buffer.getvalue()


def npz(**members):
    """The bytes of an .npz of these .npy."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return buffer.getvalue()


def image(kind, values):
    """The bytes of an image."""
    buffer = io.BytesIO()
    Image.fromarray(values).save(buffer, kind)
    return buffer.getvalue()


def png(width, height):
    """The bytes of a grey PNG of 16 bits whose values are left out."""
    whole = bytearray(image("PNG", np.zeros((1, 1), np.uint16)))
    whole[16:24] = struct.pack(">II", width, height)
    whole[29:33] = struct.pack(">I", zlib.crc32(whole[12:29]))
    return bytes(whole)


def tiff(width, height):
    """The bytes of a TIFF of 32 bits whose values are left out."""
    whole = image("TIFF", np.zeros((1, 1), np.float32))
    for tag, side in ((256, width), (257, height), (278, height)):
        at = whole.index(struct.pack("<HHI", tag, 4, 1)) + 8
        whole = whole[:at] + struct.pack("<I", side) + whole[at + 4 :]
    return whole


def encrypted(content):
    """The bytes of an archive, its members marked as encrypted."""
    for mark, at in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        start = content.index(mark) + at
        content = content[:start] + b"\1" + content[start + 1 :]
    return content


WHOLE, TIFF = npy(surface()), image("TIFF", surface())
GREY = image("PNG", surface().astype(np.uint16))
NUMBERS = {
    "text": b"no depth",
    "empty": b"",
    "cut": WHOLE[:-4],
    "longer": WHOLE + bytes(4),
    "huge": head((10**6, 10**6)),
    "larger": head((8193, 8192), "|u1") + bytes(999),
    "endless": head((10**30, 3)),
    "negative": head((-2, -3)) + bytes(24),
    "without a side": head((0, 10**15)),
    "deep": b"\x93NUMPY\1\0" + struct.pack("<H", 9999) + b"(" * 9999,
    "objects": npy(np.array([[{}]])),
    "complex": npy(np.ones((4, 4), complex)),
    "words": npy(np.array([["a"]])),
    "of fields": npy(np.zeros((4, 4), [("z", "f4")])),
    "colours": npy(np.zeros((4, 4, 3))),
}
BROKEN = {
    **{f"{name}.npy": content for name, content in NUMBERS.items()},
    **{f"{name}.npy.gz": gzip.compress(content) for name, content in NUMBERS.items()},
    **{f"{name}.npz": npz(depth=content) for name, content in NUMBERS.items()},
    "none.npy.gz": WHOLE,
    "torn.npy.gz": gzip.compress(WHOLE)[:-30],
    "none.npz": WHOLE,
    "torn.npz": npz(depth=WHOLE)[:-30],
    "locked.npz": encrypted(npz(depth=WHOLE)),
    "bare.npz": npz(),
    "two.npz": npz(a=WHOLE, b=WHOLE),
    "bomb.npz": npz(depth=head((2**14, 2**13)) + bytes(2**29)),
    **{f"{n}.{kind}": NUMBERS[n] for n in ("text", "empty") for kind in ("png", "tif")},
    "cut.png": GREY[: len(GREY) // 2],
    "bomb.png": png(60_000, 60_000),
    "larger.png": png(8193, 8192),
    "without a side.png": png(0, 9),
    "picture.png": image("PNG", np.zeros((4, 4), np.uint8)),
    "colours.png": image("PNG", np.zeros((4, 4, 3), np.uint8)),
    "cut.tiff": TIFF[: len(TIFF) // 2],
    "bomb.tiff": tiff(60_000, 60_000),
    "larger.tiff": tiff(8193, 8192),
    "without a side.tiff": tiff(0, 9),
    "picture.tiff": image("TIFF", np.zeros((4, 4), np.uint8)),
    "other.tiff": GREY[:1] + TIFF[1:],
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_named_before_they_take_memory(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(BROKEN[name])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ValueError, match=rf"{path}: ") as told:
        depths.read(path)
    assert str(told.value).isprintable()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**17


@pytest.mark.usefixtures("ten_seconds")
@pytest.mark.parametrize("suffix", depths.SUFFIXES)
def test_a_pipe_is_not_waited_for(tmp_path, suffix):
    os.mkfifo(tmp_path / f"a{suffix}")
    with pytest.raises(ValueError, match="not a file"):
        depths.read(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("kind", ["f2", ">f4", "f8", "g", "u1", "<u2", "i8"])
def test_numbers_of_any_kind_are_depth(tmp_path, kind):
    values = np.arange(12).reshape(3, 4)
    for name in ("depth", "z"):
        np.savez(tmp_path / "a.npz", **{name: values.astype(kind)})
        np.testing.assert_array_equal(depths.read(tmp_path / "a.npz"), values)
    others = {"depth": values.astype(kind), "other": values + 1}
    np.savez(tmp_path / "a.npz", **others)
    np.testing.assert_array_equal(depths.read(tmp_path / "a.npz"), values)


@pytest.mark.parametrize("kind", [np.uint16, np.int32, np.float32])
@pytest.mark.parametrize("compression", [None, "tiff_lzw", "tiff_adobe_deflate"])
def test_images_of_16_and_of_32_bits_are_depth(tmp_path, kind, compression):
    values = np.arange(12).reshape(3, 4).astype(kind)
    image = Image.fromarray(values)
    image.save(tmp_path / "a.tif", compression=compression)
    np.testing.assert_array_equal(depths.read(tmp_path / "a.tif"), values)


def test_what_is_beyond_float32_is_far_away(tmp_path):
    np.save(tmp_path / "a.npy", np.array([[1e300, np.nan], [1, 2]]))
    found = depths.read(tmp_path / "a.npy")
    np.testing.assert_array_equal(found, [[np.inf, np.nan], [1, 2]])


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
