"""The cameras that renders were seen by, and the points that come with them."""

import json

import numpy as np
import pytest

from alignerf.judged import camera_files
from tests.judged_cases import CAMTOPIX, LENS, NAMES, SIZE, transforms

POINTS = np.array([[1.0, 2, 3], [-1, 0.5, 2]])


def test_transforms(tmp_path):
    path = transforms(tmp_path / "transforms.json", train_filenames=[])
    for place in (path, tmp_path):
        found = camera_files.read(place)
        names = [shot.name for shot in found.shots]
        assert names == [f"images/{name}.png" for name in NAMES]
        assert (found.splits, found.shots[3].size) == (None, SIZE)
        camtopix, distortion = found.shots[3].of_size(SIZE)
        np.testing.assert_allclose(camtopix, CAMTOPIX)
        np.testing.assert_allclose(distortion, LENS)


def test_splits_of_nerfstudio(tmp_path):
    """Validated views are held out, and lists of some views alone say nothing."""
    files = [f"images/{name}.png" for name in NAMES]
    lists = {"train_filenames": files[2:], "val_filenames": files[:2]}
    transforms(tmp_path / "transforms.json", **lists)
    found = camera_files.read(tmp_path).splits
    assert found == {f: "train" if f not in files[:2] else "test" for f in files}
    transforms(tmp_path / "transforms.json", train_filenames=files[2:])
    assert camera_files.read(tmp_path).splits is None


def entry(name, **more):
    turn = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    content = {"img_name": name, "width": 160, "height": 120, "fx": 150, "fy": 150}
    return content | {"position": [1, 2, 3], "rotation": turn} | more


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ([entry("v00", fx=-1)], r"entry\[0\]\.fx is -1"),
        (
            [entry("v00", rotation=[[1, 0], [0, 1]])],
            r"entry\[0\]\.rotation is \[\[1",
        ),
        (
            [entry("v00", rotation=np.ones((3, 3)).tolist())],
            "rotation of 'v00' is none",
        ),
        ([entry(3)], r"entry\[0\]\.img_name is 3"),
        ([entry("v00"), 7], r"entry\[1\]: not an object"),
        ([], "not an object"),
    ],
)
def test_gaussian_cameras_that_are_none(tmp_path, content, says):
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps(content))
    with pytest.raises(ValueError, match=says):
        camera_files.read(path)


def test_no_cameras(tmp_path):
    with pytest.raises(ValueError, match=r"no cameras in it: transforms\.json, "):
        camera_files.read(tmp_path)
    (tmp_path / "README.md").touch()
    with pytest.raises(ValueError, match=r"README\.md: no file of cameras: transforms"):
        camera_files.read(tmp_path / "README.md")
    with pytest.raises(ValueError, match="no such file or folder of cameras"):
        camera_files.read(tmp_path / "gone")


def test_assumed_cameras_can_be_normalised():
    found = camera_files.assumed(NAMES)
    poses = np.stack([shot.pose for shot in found.shots])
    assert found.kind == "none"
    assert len(np.unique(poses[:, :, 3].round(6), axis=0)) == len(NAMES)


def ply_text(form, body, count=2, fields=("x", "y", "z")):
    lines = ["ply", f"format {form} 1.0", f"element vertex {count}"]
    lines += [f"property float {name}" for name in fields]
    return ("\n".join([*lines, "end_header"]) + "\n").encode() + body


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_points(tmp_path, form):
    order = "<" if "little" in form else ">"
    body = POINTS.astype(f"{order}f4").tobytes()
    if form == "ascii":
        body = "\n".join(" ".join(map(str, row)) for row in POINTS).encode()
    (tmp_path / "points.ply").write_bytes(ply_text(form, body))
    transforms(tmp_path / "transforms.json", ply_file_path="points.ply")
    positions, colours = camera_files.read(tmp_path).points
    np.testing.assert_allclose(positions, POINTS)
    assert colours.dtype == np.uint8


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"plx\n", "begins with vertices"),
        (b"ply\nformat ascii 1.0\nelement face 2\n", "begins with vertices"),
        (ply_text("ascii", b"1 2\n3 4\n"), "not a readable"),
        (ply_text("binary_little_endian", b"\0" * 8), "end of PLY"),
        (ply_text("ascii", b"", count=10**12), "too many vertices"),
        (ply_text("ascii", b"", count=5 * 10**7), "without vertices"),
        (ply_text("binary_big_endian", b"", count=5 * 10**7), "end of PLY"),
        (ply_text("ascii", b"", fields=("x", "y")), "z properties missing"),
        (ply_text("zip", b""), "without vertices"),
    ],
)
def test_points_that_are_none(tmp_path, content, says, caplog):
    """Cameras do without, and say so."""
    path = tmp_path / "points.ply"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=says):
        camera_files.read_points(path)
    transforms(tmp_path / "transforms.json", ply_file_path="points.ply")
    assert camera_files.read(tmp_path).points is None
    assert says in caplog.text


def test_points_elsewhere_are_refused(tmp_path):
    transforms(tmp_path / "a" / "transforms.json", ply_file_path="../points.ply")
    with pytest.raises(ValueError, match="leads out of its folder"):
        camera_files.read(tmp_path / "a")


def test_colours_and_what_is_not_finite(tmp_path):
    fields = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1"), ("green", "u1")]
    fields += [("blue", "u1")]
    rows = np.array([(1, 2, 3, 9, 8, 7), (np.nan, 0, 0, 0, 0, 0)], fields)
    head = "ply\nformat binary_little_endian 1.0\ncomment a\nelement vertex 2\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    (tmp_path / "p.ply").write_bytes((head + "end_header\n").encode() + rows.tobytes())
    positions, colours = camera_files.read_points(tmp_path / "p.ply")
    assert positions.tolist() == [[1, 2, 3]]
    assert colours.tolist() == [[9, 8, 7]]
