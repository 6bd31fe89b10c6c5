"""Scenes of LLFF: rows to cameras, photos to rows, and the lens of COLMAP's model."""

import io
import logging
import pickle
import struct

import numpy as np
import pytest
from PIL import Image

from alignerf import poses
from alignerf.io import images
from alignerf.readers import llff
from alignerf.scenes import distortion

FULL = 192, 128
SIMPLE_RADIAL, OPENCV_FISHEYE = 2, 5
FOCAL_PX = 150.0


def random_pose(rng):
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    return np.concatenate([rotation, rng.normal(size=(3, 1))], axis=-1)


def row(pose):
    """LLFF's 17 numbers of an OpenGL pose: what `right` is to us is its column 1."""
    right, up, backwards, position = pose.T
    size = np.array([FULL[1], FULL[0], FOCAL_PX])
    columns = np.stack([-up, right, backwards, position, size], axis=-1)
    return np.concatenate([columns.ravel(), [1.5, 90.0]])


def write_camera(folder, *params, model=SIMPLE_RADIAL, size=FULL, count=1):
    (folder / "sparse" / "0").mkdir(parents=True, exist_ok=True)
    content = struct.pack("<QiiQQ", count, 1, model, *size)
    content += np.array(params, dtype="<f8").tobytes()
    (folder / "sparse" / "0" / "cameras.bin").write_bytes(content)


def write_photos(folder, names, *, size=(96, 64)):
    folder.mkdir()
    for i, name in enumerate(names):
        image = np.random.default_rng(i).integers(0, 256, (size[1], size[0], 3))
        Image.fromarray(image.astype(np.uint8)).save(folder / name)


@pytest.fixture
def scene(tmp_path, rng):
    """A folder of four photos at half size, its rows, and the poses they state."""
    given = np.stack([random_pose(rng) for _ in range(4)])
    rows = np.stack([row(pose) for pose in given])
    np.save(tmp_path / "poses_bounds.npy", rows)
    # By their file names, as LLFF orders its rows; stems alone put b before b-1.
    write_photos(tmp_path / "images_2", ["a.png", "b-1.png", "b.png", "c.png"])
    return tmp_path, rows, given


def test_cameras_are_read_as_written(scene, caplog):
    folder, _, given = scene
    caplog.set_level(logging.INFO, logger="alignerf")
    views = llff.read(folder)
    assert views.names == ["a", "b-1", "b", "c"]
    np.testing.assert_allclose(views.camtoworlds, given, atol=1e-12)
    camtopix = [[FOCAL_PX / 2, 0, 48], [0, FOCAL_PX / 2, 32], [0, 0, 1]]
    for pixtocam in views.pixtocams:
        np.testing.assert_allclose(np.linalg.inv(pixtocam), camtopix, atol=1e-9)
    for i, name in enumerate(views.names):
        stored = images.read(folder / "images_2" / f"{name}.png")
        np.testing.assert_array_equal(views.photos[i].read(), stored)
    assert "photos from images_2" in caplog.text
    assert "cameras.bin not found" in caplog.text


def test_photos_of_the_largest_size_are_taken(scene):
    """Intrinsics follow the photos' true size, which rounding makes another ratio."""
    folder, _, _ = scene
    names = ["a.png", "b-1.png", "b.png", "c.png"]
    (folder / "images_2").rename(folder / "images_16")
    write_photos(folder / "images_4", names, size=(97, 64))
    views = llff.read(folder)
    assert (views.width, views.height) == (97, 64)
    camtopix = np.linalg.inv(views.pixtocams[0])
    wanted = [FOCAL_PX * 97 / 192, FOCAL_PX / 2, 97 / 2, 32]
    np.testing.assert_allclose(camtopix[[0, 1, 0, 1], [0, 1, 2, 2]], wanted)
    write_photos(folder / "images", names, size=FULL)
    assert (llff.read(folder).width, llff.read(folder).height) == FULL


def test_the_lens_of_colmap_is_undone(scene):
    folder, _, _ = scene
    write_camera(folder, FOCAL_PX, 97.0, 62.0, -0.1)
    views = llff.read(folder)
    camtopix = np.array([[75.0, 0, 48.5], [0, 75.0, 31.0], [0, 0, 1]])
    lens = np.array([-0.1, 0, 0, 0, 0])
    pinhole = distortion.pinhole_camera(camtopix, lens, 96, 64)
    np.testing.assert_allclose(np.linalg.inv(views.pixtocams[3]), pinhole)
    photo = images.read(folder / "images_2" / "c.png")
    wanted = distortion.undistort(photo, camtopix, lens, pinhole)
    np.testing.assert_array_equal(views.photos[3].read(), wanted)


def npy(array):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array)
    return stream.getvalue()


def changed(rows, place, value):
    rows = rows.copy()
    rows[place] = value
    return rows


# (what it does to the folder and the rows it was written from, what the line says)
FAULTS = {
    "no file": (lambda f, _: (f / "poses_bounds.npy").unlink(), "not found"),
    "pickle": (lambda _, r: pickle.dumps(r), "not the .npy"),
    "no rows": (lambda _, r: npy(r[:0]), r"shape \(0, 17\)"),
    "shape": (lambda _, r: npy(r[:, :15]), r"shape \(4, 15\)"),
    "nan": (lambda _, r: npy(changed(r, (2, 3), np.nan)), "row 2 is not finite"),
    "inf": (lambda _, r: npy(changed(r, (1, 14), np.inf)), "row 1 is not finite"),
    "size": (lambda _, r: npy(changed(r, (3, 4), 0)), "of row 3 must be positive"),
    "focal": (lambda _, r: npy(changed(r, (0, 14), -9)), "of row 0 must be positive"),
    "scaled": (
        lambda _, r: npy(r * 1.1),
        r"bounds\.npy: its rotations are scaled by 1\.1: ",
    ),
    "mirrored": (
        lambda _, r: npy(r * np.where(np.arange(17) % 5 == 1, -1, 1)),
        r"the rotation of 'a' is mirrored",
    ),
    "count": (
        lambda f, _: (f / "images_2" / "b.png").unlink(),
        r"4 rows, but \S*images_2 3 images",
    ),
    "photo's shape": (lambda _, r: npy(changed(r, (1, 4), 64)), "b-1.png is 96x64"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_named(scene, fault):
    folder, rows, _ = scene
    path = folder / "poses_bounds.npy"
    change, named = FAULTS[fault]
    if isinstance(content := change(folder, rows), bytes):
        path.write_bytes(content)
    with pytest.raises(ValueError, match=named) as caught:
        llff.read(folder)
    assert str(folder) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("camera", "options", "named"),
    [
        ((FOCAL_PX, 96, 64, 0.0), {"count": 2}, "truncated"),
        ((FOCAL_PX, 96, 64, 0.0), {"model": OPENCV_FISHEYE}, "truncated"),
        ((FOCAL_PX, 96, 64, 0.0), {"model": 77}, "camera model"),
        ((FOCAL_PX, 96, 64), {}, "truncated"),
        ((), {}, "truncated"),
        ((np.nan, 96, 64, 0.0), {}, "nan"),
        ((-FOCAL_PX, 96, 64, 0.0), {}, "-150"),
        ((FOCAL_PX, 96, 64, np.inf), {}, "inf"),
        ((FOCAL_PX + 1, 96, 64, 0.0), {}, "focal length 150 px, but 151"),
        ((FOCAL_PX, 96, 64, 0.0), {"size": (192, 192)}, "another shape"),
        ((FOCAL_PX, 96, 64, 0.0), {"size": (0, 0)}, "positive"),
        ((FOCAL_PX, 96, 64, -9.0), {}, "distortion"),
    ],
)
def test_a_camera_that_is_none_is_named(scene, camera, options, named):
    folder, _, _ = scene
    write_camera(folder, *camera, **options)
    with pytest.raises(ValueError, match=named) as caught:
        llff.read(folder)
    assert str(folder / "sparse" / "0" / "cameras.bin") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_camera_cut_short_and_no_photos(scene):
    folder, _, _ = scene
    write_camera(folder, FOCAL_PX, 96, 64, 0.0)
    cameras_bin = folder / "sparse" / "0" / "cameras.bin"
    whole = cameras_bin.read_bytes()
    for length in (0, 4, 8, 30, 32, 50):
        cameras_bin.write_bytes(whole[:length])
        with pytest.raises(ValueError, match=r"cameras\.bin"):
            llff.read(folder)
    (folder / "images_2").rename(folder / "images_small")
    with pytest.raises(ValueError, match="neither a folder images nor"):
        llff.read(folder)


def test_the_stage_writes_the_scene(scene, tmp_path):
    folder, _, given = scene
    config = {"source": "llff", "path": str(folder), "downscale": 2, "test_every": 2}
    poses.main(config | {"min_train_views": 2}, tmp_path / "out")
    with np.load(tmp_path / "out" / "cameras.npz") as stored:
        # Sorted by view name, as every source: b comes before b-1.
        assert stored["names"].tolist() == ["a", "b", "b-1", "c"]
        assert (stored["width"], stored["height"]) == (48, 32)
        assert stored["split"].tolist() == ["test", "train"] * 2
        np.testing.assert_allclose(stored["camtoworlds"], given[[0, 2, 1, 3]])
