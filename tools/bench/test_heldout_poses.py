"""Raw captures are read as they are meant, and planted mistakes are what they say."""

import numpy as np
import pandas as pd
import pytest

from alignerf.io import images
from alignerf.scenes import cameras, distortion
from alignerf.sfm import mistakes
from tests.alignerf.sfm import made
from tools.bench import camera_plants, heldout_poses, raw_captures

COUNT = 6
SIZE = made.WIDTH, made.HEIGHT


@pytest.fixture(scope="module")
def capture():
    """Photos whose red and green say the px of a point, by an off-centre lens."""
    true = made.cameras(COUNT)
    true.camtopix[:, :2] += [[0, 0, 9.0], [0, 4.0, -5.0]]
    x, y = np.meshgrid(*(np.arange(side) + 0.5 for side in SIZE))
    photo = np.stack([x, y, 0 * x], -1) * [255 / SIZE[0], 255 / SIZE[1], 0]
    photos = [photo.round().astype(np.uint8)] * COUNT
    names = [f"v{i}" for i in range(COUNT)]
    return raw_captures.Capture(names, photos, true, true)


@pytest.fixture(scope="module")
def points():
    xyz = np.random.default_rng(0).normal(scale=0.8, size=(COUNT, 100, 3))
    return dict(enumerate(xyz))


def whole(camtopix):
    """The intrinsics of a file that counts the middle of a pixel as whole."""
    return camtopix - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]


def to_camera(pose):
    """(R, t) from the world to a camera by OpenCV's axes."""
    turn = (pose[:, :3] @ cameras.OPENGL_FROM_OPENCV).T
    return turn, -turn @ pose[:, 3]


def write_strecha(folder, lens, camtoworlds):
    (folder / "gt_dense_cameras").mkdir()
    for i, pose in enumerate(camtoworlds):
        turn, _ = to_camera(pose)
        rows = [*whole(lens), [0, 0, 0], *turn.T, pose[:, 3], SIZE]
        text = "\n".join(" ".join(map(repr, map(float, row))) for row in rows)
        (folder / "gt_dense_cameras" / f"{i:04}.jpg.camera").write_text(text)
    return "images/{:04}.jpg"


def write_middlebury(folder, lens, camtoworlds):
    lines = [f"{len(camtoworlds) + 1}"]
    for i, pose in enumerate(camtoworlds):
        turn, shift = to_camera(pose)
        numbers = np.concatenate([whole(lens).ravel(), turn.ravel(), shift]).tolist()
        lines.append(" ".join([f"t{i:04}.png", *map(repr, numbers)]))
    # One of which there is no photo.
    (folder / "t_par.txt").write_text("\n".join([*lines, "absent" + lines[-1][5:]]))
    return "t{:04}.png"


def write_dtu(folder, lens, camtoworlds):
    matrices = {}
    for i, pose in enumerate(camtoworlds):
        seen = whole(lens) @ np.column_stack(to_camera(pose))
        matrices[f"world_mat_{i}"] = np.vstack([-3.0 * seen, [0, 0, 0, 1]])
    np.savez(folder / "cameras.npz", **matrices)
    return "image/{:06}.png"


@pytest.mark.parametrize("write", [write_strecha, write_middlebury, write_dtu])
@pytest.mark.parametrize("width", [SIZE[0], SIZE[0] // 2])
def test_raw_captures_are_read_as_they_are_meant(
    write, width, capture, tmp_path, monkeypatch
):
    monkeypatch.setattr(raw_captures, "MAX_WIDTH", width)
    true, folder = capture.true, tmp_path / "of somebody"
    folder.mkdir()
    pattern = write(folder, true.camtopix[0], true.camtoworlds)
    for i, photo in enumerate(capture.photos):
        (path := folder / pattern.format(i)).parent.mkdir(exist_ok=True)
        images.write(path, photo)
    assert raw_captures.places(tmp_path) == {"of somebody": folder}
    found = raw_captures.read(folder)
    assert found.size == (width, width * SIZE[1] // SIZE[0])
    assert len(found.names) == COUNT
    now = true.scaled([width / SIZE[0]] * 2)
    np.testing.assert_allclose(found.true.camtopix, now.camtopix, atol=1e-3)
    np.testing.assert_allclose(found.true.camtoworlds, true.camtoworlds, atol=1e-6)


@pytest.mark.parametrize("case", camera_plants.CASES)
def test_photos_show_what_the_true_cameras_see(case, capture, points):
    planted = camera_plants.CASES[case][0](capture)
    shown = heldout_poses.in_photo(planted, points)
    assert len(shown) == COUNT
    for view, xyz in shown.items():
        before = heldout_poses.pixels(capture.true, view, xyz)
        column, row = np.floor(heldout_poses.pixels(planted.true, view, xyz)).T
        colours = planted.photos[view][row.astype(int), column.astype(int), :2]
        off_px = np.abs(colours / 255 * SIZE - before)
        assert off_px.max() < 2.5, case


@pytest.mark.parametrize("case", camera_plants.CASES)
def test_only_right_cameras_are_right(case, capture, points):
    planted = camera_plants.CASES[case][0](capture)
    shown = heldout_poses.in_photo(planted, points)
    off_px = heldout_poses.off_px(planted.given, planted.true, shown)
    if case in ("right", "rotations_times_1.02"):
        assert off_px.max() < 1e-3
    elif case.startswith("off_"):
        assert 0.3 < np.median(off_px) / float(case.split("_")[1]) < 2
    else:
        assert off_px.max() > 0.5
    same = {"k1_left_out", "every_third_zoomed", "rolled_90_degrees"}
    assert (planted.photos is capture.photos) == (case not in same)


@pytest.mark.parametrize(
    ("case", "convention"),
    [("axes_of_opencv", "opencv"), ("world_to_camera", "world_to_camera")],
)
def test_a_convention_is_that_which_is_undone(case, convention, capture):
    given = camera_plants.CASES[case][0](capture).given.camtoworlds
    undone = mistakes.undone(convention, capture.names, given)
    np.testing.assert_allclose(undone, capture.true.camtoworlds, atol=1e-12)


@pytest.mark.parametrize("colmap", [False, True])
def test_a_scan_is_read_as_it_was_given(colmap, capture, tmp_path):
    planted = camera_plants.xyzw(capture)
    heldout_poses.write_scan(tmp_path / "scan", planted, colmap=colmap)
    found, given = heldout_poses.as_read(tmp_path / "scan", planted), planted.given
    np.testing.assert_allclose(found.camtoworlds, given.camtoworlds, atol=1e-6)
    np.testing.assert_allclose(found.camtopix, given.camtopix, atol=1e-6)


def test_the_lens_behind_an_undistorted_photo_is_found(rng):
    for _ in range(4):
        k1, k2 = rng.uniform(-0.1, 0.1, 2)
        coefficients = np.array([k1, k2, 0, 0, 0])
        focal_x, focal_y, off_x, off_y = rng.uniform(
            [400, 400, -20, -20], [800, 800, 20, 20]
        )
        lens = np.array(
            [[focal_x, 0, 320 + off_x], [0, focal_y, 240 + off_y], [0, 0, 1]]
        )
        pinhole = distortion.pinhole_camera(lens, coefficients, *SIZE)
        found = heldout_poses.lens_of(pinhole, coefficients, SIZE)
        np.testing.assert_allclose(found, lens, atol=0.01)


def test_rows_of_other_rules_are_refused_and_others_kept(tmp_path):
    path = tmp_path / "rows.csv"
    rows = [{"capture": "a", "case": "right", "line": "it's 'so', and", "rules": "01"}]
    heldout_poses.write(path, rows)
    assert heldout_poses.rows_of(path, "01") == rows
    assert pd.read_csv(path, comment="#").shape == (1, 4)
    assert " --captures a " in path.read_text()
    with pytest.raises(ValueError, match=r"rows\.csv: .*01, not 1b"):
        heldout_poses.rows_of(path, "1b")
