"""Folders of phones' apps: cameras, photos, and what is said of bad ones."""

import json

import numpy as np
import pytest

from alignerf import poses
from alignerf.captures import base, polycam
from alignerf.colmap import structure
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.readers import shots
from alignerf.scenes import cameras, prepared
from tests import app_cases as cases

APPS = ("polycam", "scanner3d", "record3d")
# ARKit's pixels begin in the middle of the first: half a pixel from its corner.
CENTRES_PX = {"polycam": 0.0, "scanner3d": 0.5, "record3d": 0.0}
# As ours have them.
NAMES = {
    "polycam": ["638443502", "638444502", "638445502"],
    "scanner3d": ["frame_00000", "frame_00003", "frame_00006"],
    "record3d": ["000000", "000001", "000002"],
}


def read(app, folder):
    """(views, names of photos left out) by an app's own poses."""
    return base.every()[app].read_given(
        of_scenes.checked({"source": app, "path": str(folder)})
    )


@pytest.fixture
def given(rng):
    return cases.camtoworlds(rng, 3)


@pytest.mark.parametrize("app", APPS)
def test_a_point_is_seen_where_the_phone_saw_it(tmp_path, given, rng, app):
    getattr(cases, app)(tmp_path, given)
    views, left_out = read(app, tmp_path)
    assert (views.names, left_out) == (NAMES[app], [])
    assert (views.width, views.height) == cases.SIZE
    np.testing.assert_allclose(views.camtoworlds, given, atol=1e-9)
    for i, pose in enumerate(given):
        # Anywhere before the camera.
        local = np.array([*rng.uniform(-0.3, 0.3, 2), -1.0]) * rng.uniform(1, 5)
        point = pose[:, :3] @ local + pose[:, 3]
        wanted = cases.as_apple(point, pose) + CENTRES_PX[app]
        seen, depth = cameras.project(point, views.pixtocams[i], views.camtoworlds[i])
        assert depth > 0
        np.testing.assert_allclose(seen, wanted, atol=1e-6)
        photo = views.photos[i].read()
        assert photo.shape == (48, 64, 3)
        assert abs(int(photo.mean()) - 10 * i) <= 2


# The first frame of laanlabs/3dScannerApp_samples, chair_scan: a photo of 1920x1440.
FRAME = {
    "cameraPoseARFrame": [
        *(0.82525503635406494, 0.39880329370498657, -0.39988726377487183),
        *(-0.40769326686859131, -0.010261503979563713, 0.71853721141815186),
        *(0.69541257619857788, 1.4488900899887085, 0.56466680765151978),
        *(-0.56978940963745117, 0.59706878662109375, 1.305903434753418),
        *(0, 0, 0, 0.99999988079071045),
    ],
    "projectionMatrix": [
        *(1.5079731941223145, 0, -0.0068008899688720703, 0),
        *(0, 2.0106310844421387, -0.038609027862548828, 0),
        *(0, 0, -0.9999997615814209, -0.00099999981466680765, 0, 0, -1, 0),
    ],
    "intrinsics": [
        *(1447.654296875, 0, 966.02886962890625),
        *(0, 1447.654296875, 691.7015380859375, 0, 0, 1),
    ],
}


def test_a_real_frame_is_projected_as_the_app_projects_it(tmp_path, rng):
    """By its projectionMatrix, which has a photo's borders, not its pixels."""
    cases.write_photo(tmp_path / "frame_00000.jpg", size=(1920, 1440))
    cases.write_json(tmp_path / "frame_00000.json", FRAME)
    views, _ = read("scanner3d", tmp_path)
    pose = np.array(FRAME["cameraPoseARFrame"]).reshape(4, 4)
    local = np.append(rng.uniform(-1, 1, (50, 2)), -rng.uniform(2, 5, (50, 1)), axis=1)
    clip = np.append(local, np.ones((50, 1)), axis=1) @ (
        np.array(FRAME["projectionMatrix"]).reshape(4, 4).T
    )
    # x from -1 at the left border to 1 at the right; y upwards.
    wanted = (clip[:, :2] / clip[:, 3:] * [1, -1] + 1) * [960, 720]
    points = local @ pose[:3, :3].T + pose[:3, 3]
    seen, _ = cameras.project(points, views.pixtocams[0], views.camtoworlds[0])
    # Without the half pixel that ARKit's centres are off by, it would be 0.7 px.
    np.testing.assert_allclose(seen, wanted, atol=0.01)


def test_optimised_poses_of_polycam_are_taken_and_borders_cut_off(tmp_path, rng, given):
    cases.polycam(tmp_path, cases.camtoworlds(rng, 3))
    record = base.every()["polycam"]
    assert record.tracked_by_phone(tmp_path)
    # Larger photos than the cameras are of: twice.
    cases.polycam(tmp_path, given, kinds=polycam.CORRECTED)
    for path in (tmp_path / "keyframes/corrected_images").iterdir():
        cases.write_photo(path, size=(128, 96))
    views, _ = read("polycam", tmp_path)
    assert not record.tracked_by_phone(tmp_path)
    np.testing.assert_allclose(views.camtoworlds, given, atol=1e-12)
    assert (views.width, views.height) == (98, 66)
    assert views.photos[0].read().shape == (66, 98, 3)
    fx, fy, cx, cy = cases.LENS
    wanted = [[2 * fx, 0, 2 * cx - 15], [0, 2 * fy, 2 * cy - 15], [0, 0, 1]]
    np.testing.assert_allclose(np.linalg.inv(views.pixtocams[0]), wanted, atol=1e-9)
    # The folder keyframes itself will do.
    assert read("polycam", tmp_path / "keyframes")[0].names == views.names


def test_each_frame_of_record3d_has_its_own_lens(tmp_path, given):
    lenses = [[60.0 + i, 61.0 + i, 31.0, 25.0] for i in range(3)]
    cases.record3d(tmp_path, given, perFrameIntrinsicCoeffs=lenses)
    focal = np.linalg.inv(read("record3d", tmp_path)[0].pixtocams)[:, 0, 0]
    np.testing.assert_allclose(focal, [60, 61, 62])
    # Of another film.
    cases.record3d(tmp_path, given, perFrameIntrinsicCoeffs=lenses[:2])
    focal = np.linalg.inv(read("record3d", tmp_path)[0].pixtocams)[:, 0, 0]
    np.testing.assert_allclose(focal, [60, 60, 60])


def test_an_unpacked_r3d_is_read_too(tmp_path, given):
    cases.record3d(tmp_path, given)
    (tmp_path / "metadata.json").rename(tmp_path / "metadata")
    (tmp_path / "rgb").rename(tmp_path / "rgbd")
    np.testing.assert_allclose(
        read("record3d", tmp_path)[0].camtoworlds, given, atol=1e-9
    )


def test_record3d_without_its_poses_is_named(tmp_path, given):
    cases.record3d(tmp_path, given)
    (tmp_path / "metadata.json").unlink()
    with pytest.raises(ValueError, match=r"no metadata\.json"):
        read("record3d", tmp_path)


def test_of_a_long_film_some_frames_are_taken_by_their_number(
    tmp_path, rng, monkeypatch
):
    monkeypatch.setattr(shots, "MAX_FRAMES", 4)
    given = cases.camtoworlds(rng, 13)
    views, _ = read("record3d", cases.record3d(tmp_path, given))
    # Not 0, 10, 11, 12, ...: names of files are no order.
    assert views.names == ["000000", "000004", "000008", "000012"]
    np.testing.assert_allclose(views.camtoworlds, given[::4], atol=1e-9)


@pytest.mark.parametrize("app", APPS)
def test_photos_without_a_camera_are_left_out_by_name(tmp_path, given, app, caplog):
    getattr(cases, app)(tmp_path, given)
    if app == "record3d":
        rows = json.loads((tmp_path / "metadata.json").read_text())["poses"]
        cases.change(tmp_path / "metadata.json", poses=rows[:2])
    else:
        (path,) = tmp_path.rglob(f"{NAMES[app][2]}.json")
        path.unlink()
    views, left_out = read(app, tmp_path)
    assert (views.names, left_out) == (NAMES[app][:2], NAMES[app][2:])
    assert NAMES[app][2] in caplog.text


def first_json(folder, app):
    if app == "record3d":
        return folder / "metadata.json"
    (path,) = folder.rglob(f"{NAMES[app][0]}.json")
    return path


@pytest.mark.parametrize(
    ("app", "keys", "named"),
    [
        ("polycam", {"t_02": None}, "no t_02"),
        ("polycam", {"t_02": "0"}, "t_02 is '0'"),
        ("polycam", {"t_02": float("nan")}, "t_02 is nan"),
        ("polycam", {"t_00": 5.0}, "rotation of '638443502' is none"),
        ("polycam", {"fx": 0}, "a PINHOLE camera of parameters"),
        ("polycam", {"fx": 1e301}, "fx is 1e"),
        ("polycam", {"width": True}, "width is True"),
        ("polycam", {"width": 48, "height": 64}, "turned against"),
        ("polycam", {"width": 0}, "must be positive"),
        ("polycam", {"width": 5e-324}, "another shape"),
        ("scanner3d", {"intrinsics": None}, "no intrinsics"),
        ("scanner3d", {"intrinsics": [1] * 8}, r"intrinsics is \[1, 1"),
        ("scanner3d", {"intrinsics": [60, 0, 0, 0, 60, 0, 31, 25, 1]}, "not fx 0 cx"),
        (
            "scanner3d",
            {"intrinsics": [60, 0, 960.4, 0, 60, 720.2, 0, 0, 1]},
            "not of frame_00000.jpg, which is 64x48",
        ),
        ("scanner3d", {"cameraPoseARFrame": [0] * 16}, "last row"),
        ("scanner3d", {"cameraPoseARFrame": [0] * 15 + [1]}, "is none"),
        ("scanner3d", {"cameraPoseARFrame": [[1]] * 16}, r"ARFrame\[0\] is \[1\]"),
        ("record3d", {"poses": None}, "no poses"),
        ("record3d", {"poses": []}, "none of a photo"),
        (
            "record3d",
            {"poses": [[0, 0, 0, 0, i, 2, 3] for i in range(3)]},
            "rotation of '000000' is none",
        ),
        ("record3d", {"poses": [[0, 0, 0, 1, 1, 2]] * 3}, r"poses\[0\] is \[0"),
        ("record3d", {"poses": [[0, 0, 0, 1, 0, 0, 0]] * 3}, "front camera"),
        ("record3d", {"K": None}, "no K in it"),
        ("record3d", {"K": [60, 0, 31, 0, 60, 25, 0, 0, 1]}, "K is not"),
        ("record3d", {"K": [-60, 0, 0, 0, 60, 0, 31, 25, 1]}, "K: a PINHOLE camera of"),
        ("record3d", {"w": 48, "h": 64}, "turned against"),
        ("record3d", {"w": "64"}, "w is '64'"),
        ("record3d", {"perFrameIntrinsicCoeffs": [3, 4, 5]}, r"Coeffs\[0\] is 3"),
    ],
)
def test_a_bad_number_is_named_with_its_file(tmp_path, given, app, keys, named):
    getattr(cases, app)(tmp_path, given)
    path = first_json(tmp_path, app)
    cases.change(path, **keys)
    with pytest.raises(ValueError, match=named) as raised:
        read(app, tmp_path)
    assert "\n" not in str(raised.value)
    assert str(tmp_path) in str(raised.value)


@pytest.mark.parametrize(
    ("app", "name", "named"),
    [
        ("polycam", "keyframes/images/638443502.png", "same view name"),
        ("scanner3d", "frame_00000.png", "same view name"),
        ("record3d", "rgb/01.jpg", "two photos of frame 1"),
        ("record3d", "rgb/..a.jpg", None),
        ("record3d", "rgb/a.jpg", "no frame's number"),
        ("record3d", "rgb/²2.jpg", "no frame's number"),
    ],
)
def test_names_that_are_none_or_twice(tmp_path, given, app, name, named):
    getattr(cases, app)(tmp_path, given)
    cases.write_photo(tmp_path / name)
    if named is None:
        assert len(read(app, tmp_path)[0].names) == 3
        return
    with pytest.raises(ValueError, match=named):
        read(app, tmp_path)


def test_a_broken_photo_and_one_of_another_size_are_named(tmp_path, given):
    cases.scanner3d(tmp_path, given)
    path = tmp_path / "frame_00003.jpg"
    cases.write_photo(path, size=(60, 48))
    with pytest.raises(ValueError, match="frame_00003"):
        read("scanner3d", tmp_path)
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(ValueError, match=r"frame_00003\.jpg"):
        read("scanner3d", tmp_path)


def test_quaternions_of_a_thousand_rotations(rng):
    for pose in cases.camtoworlds(rng, 1000):
        found = shots.rotation_of(1.03 * np.array(cases.quaternion(pose[:, :3])))
        np.testing.assert_allclose(found, 1.03 * pose[:, :3], atol=1e-9)


@pytest.mark.parametrize("app", APPS)
def test_the_scene_says_whose_poses_it_has(tmp_path, rng, app, caplog):
    given = cases.camtoworlds(rng, 6)
    getattr(cases, app)(tmp_path / "in", given)
    config = {"source": app, "path": str(tmp_path / "in"), "triangulate": False}
    config["test_every"] = 3
    with caplog.at_level("INFO"):
        poses.main(config, tmp_path / "out")
    told = json.loads((tmp_path / "out/poses.json").read_text())
    assert told["of_poses"] == "poses of the phone: expect pixels of error"
    assert told["of_poses"] in caplog.text
    assert (told["poses"], told["source"], told["registered"]) == ("input", app, 6)
    loaded = prepared.load(tmp_path / "out")
    assert (loaded.width, loaded.height) == cases.SIZE


@pytest.mark.parametrize("app", APPS)
def test_colmap_gets_the_same_photos_and_no_other_files(
    tmp_path, given, app, monkeypatch
):
    getattr(cases, app)(tmp_path / "in", given)
    asked = {}

    def pose_folder(folder, *args, **options):
        asked["names"] = sorted(path.stem for path in folder.iterdir())
        raise ValueError(f"{options['where']}: seen")

    monkeypatch.setattr(structure, "pose_folder", pose_folder)
    config = {"source": app, "path": str(tmp_path / "in"), "poses": "colmap"}
    with pytest.raises(ValueError, match=r"in: seen$"):
        poses.main(config, tmp_path / "out")
    assert asked["names"] == NAMES[app]
    assert not (tmp_path / "out/poses.json").exists()


@pytest.mark.parametrize("app", APPS)
def test_photos_of_a_prepared_scene_are_found_once_more(tmp_path, given, app):
    """By COLMAP's lenses, which lie in the scene's folder."""
    getattr(cases, app)(tmp_path / "in", given)
    folder = tmp_path / "scene/images"
    folder.mkdir(parents=True)
    (tmp_path / "work").mkdir()
    lens = np.array([[60.0, 0, 32], [0, 60, 24], [0, 0, 1]])
    np.savez(
        folder / "lenses.npz",
        names=np.array(NAMES[app]),
        camtopix=np.tile(lens, (3, 1, 1)),
        distortion=np.zeros((3, 5)),
        camera_of=np.zeros(3, int),
    )
    config = {"source": app, "path": str(tmp_path / "in"), "poses": "colmap"}
    config = of_scenes.checked(config)
    views = base.of(config).at_full_size(config, tmp_path / "scene", tmp_path / "work")
    assert views.names == NAMES[app]
    assert abs(int(views.photos[2].read().mean()) - 20) <= 2


def test_a_link_to_nothing_among_the_photos_is_named(tmp_path, rng, caplog):
    """Found by the torture."""
    folder = cases.polycam(tmp_path / "in", cases.camtoworlds(rng, 4))
    first = min((folder / "keyframes/images").iterdir())
    first.unlink()
    first.symlink_to("nowhere")
    views, _ = read("polycam", folder)
    assert len(views.names) == 3
    assert f"ignored {first.name}: no files" in caplog.text
