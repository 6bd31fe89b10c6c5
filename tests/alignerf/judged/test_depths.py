"""Depth of another program's renders: its files, its kind, its unit."""

import io
import resource
import struct
import zipfile

import numpy as np
import pytest

from alignerf.judged import depths
from alignerf.scenes import cameras

SIZE = (96, 64)
PIXTOCAM = np.linalg.inv(np.array([[60.0, 0, 48], [0, 60.0, 32], [0, 0, 1]]))
POSE = np.eye(4)[:3]


def surface():
    """A slanted, waved surface: its depth [h, w]."""
    y, x = np.indices(SIZE[::-1])
    return (3 + 0.01 * x + 0.5 * np.sin(y / 9)).astype(np.float32)


def points_of(depth, count=400):
    """Points on the surface, in the world."""
    rng = np.random.default_rng(0)
    column, row = rng.integers(0, SIZE[0], count), rng.integers(0, SIZE[1], count)
    at = np.stack([column + 0.5, row + 0.5, np.ones(count)], -1)
    rays = at @ PIXTOCAM.T * depth[row, column][:, None]
    return rays * [1, -1, -1]


def test_files_are_called_like_their_views(tmp_path):
    """Also in folders of splits; what else lies there is none."""
    for place in ("train/a.npy", "test/b.npz", "train/a.png", "c.npy"):
        (tmp_path / place).parent.mkdir(exist_ok=True)
        (tmp_path / place).write_bytes(b"")
    found = depths.find(tmp_path, ["a", "b"])
    assert {name: path.name for name, path in found.items()} == {
        "a": "a.npy",
        "b": "b.npz",
    }
    (tmp_path / "a.npy").write_bytes(b"")
    with pytest.raises(ValueError, match="both of view a"):
        depths.find(tmp_path, ["a", "b"])


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


def encrypted(content):
    """The bytes of an archive, its members marked as encrypted."""
    for mark, at in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        start = content.index(mark) + at
        content = content[:start] + b"\1" + content[start + 1 :]
    return content


def bomb():
    """An archive that takes no memory to make, or the peak would tell nothing."""
    buffer = io.BytesIO()
    with (
        zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("depth.npy", "w") as member,
    ):
        member.write(head((2**14, 2**13), "<f2"))
        for _ in range(2**8):
            member.write(bytes(2**20))
    return buffer.getvalue()


WHOLE = npy(surface())
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
    **{f"{name}.npy": lambda c=content: c for name, content in NUMBERS.items()},
    **{
        f"{name}.npz": lambda c=content: npz(depth=c)
        for name, content in NUMBERS.items()
    },
    "none.npz": lambda: WHOLE,
    "torn.npz": lambda: npz(depth=WHOLE)[:-30],
    "locked.npz": lambda: encrypted(npz(depth=WHOLE)),
    "bare.npz": npz,
    "two.npz": lambda: npz(a=WHOLE, b=WHOLE),
    "bomb.npz": bomb,
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_named_before_they_take_memory(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(BROKEN[name]())
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ValueError, match=rf"{path}: ") as told:
        depths.read(path)
    assert str(told.value).isprintable()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**17


@pytest.mark.parametrize("kind", ["f2", ">f4", "f8", "g", "u1", "<u2", "i8"])
def test_numbers_of_any_kind_are_depth(tmp_path, kind):
    values = np.arange(12).reshape(3, 4)
    for name in ("depth", "z"):
        np.savez(tmp_path / "a.npz", **{name: values.astype(kind)})
        np.testing.assert_array_equal(depths.read(tmp_path / "a.npz"), values)
    others = {"depth": values.astype(kind), "other": values + 1}
    np.savez(tmp_path / "a.npz", **others)
    np.testing.assert_array_equal(depths.read(tmp_path / "a.npz"), values)


def test_what_is_beyond_float32_is_far_away(tmp_path):
    np.save(tmp_path / "a.npy", np.array([[1e300, np.nan], [1, 2]]))
    found = depths.read(tmp_path / "a.npy")
    np.testing.assert_array_equal(found, [[np.inf, np.nan], [1, 2]])


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


def seen_by(times):
    """Points of the surface, and its depth as views have it, times so much of each."""
    depth = surface()
    views = [(depth * factor, PIXTOCAM, POSE) for factor in times]
    return points_of(depth), views


@pytest.mark.parametrize(
    ("times", "unit"),
    [
        ([1.0, 1.02, 0.97, 1.0], 1),
        ([1.15] * 4, 1),
        # Of a model whose shape is wrong: in each view by another factor.
        ([1.0, 2.0, 1.5, 3.0], 1),
        ([1000.0, 1010.0, 990.0, 1000.0], 1000),
        ([0.001] * 4, 0.001),
        ([103.0] * 4, 100),
        # Too few views.
        ([2.5, 2.5], 1),
    ],
)
def test_depth_in_another_unit_of_length_is_told_and_divided(times, unit, caplog):
    assert depths.unit_of("x", *seen_by(times)) == unit
    assert len(caplog.messages) == (unit != 1)
    assert depths.unit_of("x", points_of(surface())[:5], seen_by(times)[1]) == 1


@pytest.mark.parametrize("times", [1.3, 2.5, 0.4, 37.0])
def test_depth_of_another_scale_than_the_cameras_is_refused(times):
    why = rf"depths: its depth is {times:.4g} times that .* divide it by {times:.4g}"
    with pytest.raises(ValueError, match=why):
        depths.unit_of("depths", *seen_by([times] * 4))
    unknown = [
        (np.full_like(values, np.nan), *camera)
        for values, *camera in seen_by([times] * 4)[1]
    ]
    assert depths.unit_of("depths", points_of(surface()), unknown) == 1


@pytest.mark.parametrize("flat", [1.5, 6.0, 9.0])
def test_a_model_without_a_shape_is_judged_all_the_same(flat, caplog):
    """Its depth is that of the cameras times something, and of another in each part."""
    points, views = seen_by([1.0] * 4)
    views = [(np.full_like(values, flat), *camera) for values, *camera in views]
    assert depths.unit_of("depths", points, views) == 1
    assert "is it along the optical axis?" in caplog.text
