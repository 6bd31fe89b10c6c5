"""camera_path.json: as nerfstudio reads it, and as anybody may have changed it."""

import json

import numpy as np
import pytest

from alignerf.files import faults
from alignerf.flythrough import camera_path, nerfstudio
from alignerf.scenes import cameras, prepared
from tests import job_cases
from tests.alignerf.flythrough import captures

SIZE = 64, 48
PATH = nerfstudio.CameraPath(captures.ring(5), np.full(5, 40.0), *SIZE, 24.0)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "camera_path.json"
    path.write_text(json.dumps(nerfstudio.content(PATH)))
    return path


def change(file, at, value):
    """The JSON of a file with something else at a way of keys."""
    content = json.loads(file.read_text())
    inside = content
    for key in at[:-1]:
        inside = inside[key]
    inside[at[-1]] = value
    file.write_text(json.dumps(content))


def as_nerfstudio(content):
    """(pixtocams, poses) as its get_path_from_json makes them of the file's text."""
    width, height = content["render_width"], content["render_height"]
    assert content["camera_type"] == "perspective"
    found = []
    for one in content["camera_path"]:
        pose = np.array(one["camera_to_world"]).reshape(4, 4)[:3]
        focal_px = height / 2 / np.tan(one["fov"] * np.pi / 180 / 2)
        found.append((cameras.intrinsics(focal_px, width, height), pose))
    return found


def test_what_is_written_is_read(file):
    found = nerfstudio.read(file)
    np.testing.assert_allclose(found.poses, PATH.poses, atol=1e-12)
    np.testing.assert_array_equal(found.fov_deg, PATH.fov_deg)
    assert found[2:] == PATH[2:]


def test_nerfstudio_sees_the_same(file):
    content = json.loads(file.read_text())
    points = np.random.default_rng(0).normal(size=(20, 3))
    focal_px = nerfstudio.focal_px(40.0, SIZE[1])
    own = cameras.intrinsics(focal_px, *SIZE)
    for (lens, pose), mine in zip(as_nerfstudio(content), PATH.poses, strict=True):
        theirs, _ = cameras.project(points, lens, pose)
        np.testing.assert_allclose(theirs, cameras.project(points, own, mine)[0])
    assert content["seconds"] == pytest.approx(5 / 24)
    assert content["crop"] is None


def test_a_field_of_view_is_that_of_a_focal_length():
    for fov_deg in (5.0, 40.0, 120.0):
        focal_px = nerfstudio.focal_px(fov_deg, 48)
        assert nerfstudio.fov_deg(focal_px, 48) == pytest.approx(fov_deg)
    assert nerfstudio.focal_px(90.0, 48) == pytest.approx(24)


def test_in_nerfstudios_frame_the_same_is_seen(file, tmp_path):
    """A similarity of the world and of all cameras changes no image."""
    turn = captures.ring(7)[3, :, :3]
    transform, scale = np.column_stack([turn, [1.0, -2.0, 0.5]]), 0.3
    said = tmp_path / "dataparser_transforms.json"
    said.write_text(json.dumps({"transform": transform.tolist(), "scale": scale}))
    found = nerfstudio.in_frame(PATH, *nerfstudio.read_transforms(said))
    points = np.random.default_rng(0).normal(size=(20, 3))
    moved = scale * (points @ transform[:, :3].T + transform[:, 3])
    lens = cameras.intrinsics(60.0, *SIZE)
    for before, after in zip(PATH.poses, found.poses, strict=True):
        seen, depth = cameras.project(points, lens, before)
        again, further = cameras.project(moved, lens, after)
        np.testing.assert_allclose(again, seen)
        np.testing.assert_allclose(further, scale * depth)


@pytest.mark.parametrize(
    ("at", "value", "said"),
    [
        (["camera_path"], [], "0 cameras"),
        (["camera_path"], None, "camera_path is None"),
        (["fps"], 0, "so many frames a second"),
        (["render_width"], 10**9, "no film has such a size"),
        (["render_height"], 12.5, "render_height is 12.5"),
        (["camera_path", 2], 7, "camera 2: not an object"),
        (["camera_path", 2, "fov"], 180, "camera 2 is none"),
        (["camera_path", 2, "fov"], True, "camera 2: fov is True"),
        (["camera_path", 2, "camera_to_world"], [1.0] * 15, "camera 2: cannot reshape"),
        (["camera_path", 2, "camera_to_world"], ["x"] * 16, "camera 2: could not"),
        (
            ["camera_path", 2, "camera_to_world"],
            [2.0] * 16,
            "camera 2 is not a rotation",
        ),
        (["camera_path", 2, "camera_to_world", 3], 1e200, "camera 2 is none"),
    ],
)
def test_a_damaged_path_is_refused_by_name(file, at, value, said):
    change(file, at, value)
    with pytest.raises(ValueError, match=said) as error:
        nerfstudio.read(file)
    assert str(error.value).startswith(f"{file}: ")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"transform": np.eye(4).tolist(), "scale": 1}, "not 3x4 numbers"),
        ({"transform": [["x"] * 4] * 3, "scale": 1}, "not 3x4 numbers"),
        ({"transform": np.eye(4)[:3].tolist(), "scale": 0}, "'scale' is 0"),
        ({"transform": (2 * np.eye(4)[:3]).tolist(), "scale": 1}, "not a rotation"),
        ({"transform": np.eye(4)[:3].tolist(), "scale": 1e30}, "'scale' is 1e"),
        ({"scale": 1}, "no transform in it"),
    ],
)
def test_damaged_transforms_are_refused_by_name(tmp_path, content, said):
    file = tmp_path / "dataparser_transforms.json"
    file.write_text(json.dumps(content))
    with pytest.raises(ValueError, match=said) as error:
        nerfstudio.read_transforms(file)
    assert str(error.value).startswith(f"{file}: ")


def saved_by_nerfstudio(transform, scale, meta):
    """What its nerfstudio_dataparser.py saves of a transforms.json."""
    if "applied_transform" in meta:
        whole = np.concatenate([meta["applied_transform"], [[0, 0, 0, 1]]])
        transform = transform @ whole
    scale *= meta.get("applied_scale", 1.0)
    return {"transform": transform.tolist(), "scale": scale}


@pytest.mark.parametrize("keys", ["", "applied_transform", "both"])
def test_what_was_applied_before_training_is_taken_off(tmp_path, keys):
    transform = np.column_stack([captures.ring(7)[3, :, :3], [1.0, -2.0, 0.5]])
    meta = {"frames": []}
    if keys:
        applied = [[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0.25]]
        meta["applied_transform"] = applied
    if keys == "both":
        meta["applied_scale"] = 2.0
    saved, data = tmp_path / "dataparser_transforms.json", tmp_path / "transforms.json"
    saved.write_text(json.dumps(saved_by_nerfstudio(transform, 0.3, meta)))
    data.write_text(json.dumps(meta))
    found, scale = nerfstudio.read_transforms(saved, data)
    np.testing.assert_allclose(found, transform, atol=1e-12)
    assert scale == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("applied_transform", [1, 2], "'applied_transform' is not 3x4 numbers"),
        ("applied_transform", np.zeros((3, 4)).tolist(), "is not a rotation"),
        ("applied_scale", "large", "'applied_scale' is 'large'"),
        ("applied_scale", True, "'applied_scale' is True"),
    ],
)
def test_damaged_keys_of_the_data_are_refused_by_name(tmp_path, key, value, said):
    saved, data = tmp_path / "dataparser_transforms.json", tmp_path / "transforms.json"
    saved.write_text(json.dumps(saved_by_nerfstudio(np.eye(4)[:3], 0.3, {})))
    data.write_text(json.dumps({key: value}))
    with pytest.raises(ValueError, match=said) as error:
        nerfstudio.read_transforms(saved, data)
    assert str(error.value).startswith(f"{data}: ")


def scene_of(folder, poses, **more):
    """A prepared scene with these cameras."""
    folder.mkdir(exist_ok=True)
    count = len(poses)
    lens = cameras.intrinsics(60.0, *SIZE)
    arrays = {
        "pixtocams": np.stack([lens] * count),
        "camtoworlds": poses,
        "names": [f"v{i}" for i in range(count)],
        "width": SIZE[0],
        "height": SIZE[1],
        "split": ["test", *["train"] * (count - 1)],
    }
    np.savez(folder / "cameras.npz", **arrays | more)
    return folder


def test_a_scenes_path_is_in_the_frame_of_its_cameras(tmp_path):
    """A similarity of all cameras takes the path along."""
    poses = captures.ring(24, noise=0.05)
    turn = captures.ring(7)[3, :, :3]
    moved = cameras.apply_similarity(poses, 7.0, turn, np.array([100.0, 20.0, -3.0]))
    found = camera_path.of_scene(scene_of(tmp_path / "one", poses))
    other = camera_path.of_scene(scene_of(tmp_path / "two", moved))
    apart = np.linalg.norm(
        other.poses[:, None, :, 3] - moved[None, :, :, 3], axis=-1
    ).min(axis=1)
    assert apart.max() < 7 * 1.5
    # The ellipse may begin elsewhere and go round the other way: by its extent.
    for one, own, scale in ((found, poses, 1), (other, moved, 7)):
        spread = np.linalg.norm(one.poses[:, :, 3] - own[:, :, 3].mean(axis=0), axis=-1)
        assert spread == pytest.approx([4 * scale] * len(spread), rel=0.1)
    assert found.fov_deg[0] == pytest.approx(nerfstudio.fov_deg(60.0, SIZE[1]))


def test_the_command_writes_a_path_of_the_photos_size(tmp_path, capsys):
    folder = scene_of(tmp_path / "scene", captures.walk())
    poses = {"width": 64, "photo_width": 641, "registered": 40, "total": 40}
    poses |= {"mean_reprojection_error_px": None}
    (folder / "poses.json").write_text(json.dumps(poses))
    out = tmp_path / "camera_path.json"
    camera_path.main(["--scene", str(folder), "--out", str(out)])
    found = nerfstudio.read(out)
    assert (found.width, found.height, found.fps) == (640, 480, 24)
    assert len(found.poses) == 120
    assert prepared.load(folder).width == 64


def test_the_command_writes_a_path_in_nerfstudios_frame(tmp_path, capsys):
    folder, out = scene_of(tmp_path / "scene", captures.walk()), tmp_path / "path.json"
    saved = tmp_path / "dataparser_transforms.json"
    transform = np.column_stack([captures.ring(7)[3, :, :3], [1.0, -2.0, 0.5]])
    saved.write_text(json.dumps({"transform": transform.tolist(), "scale": 0.3}))
    words = ["--scene", str(folder), "--out", str(out)]
    camera_path.main([*words, "--dataparser", str(saved)])
    own = camera_path.of_scene(folder)
    expected = nerfstudio.in_frame(own, transform, 0.3).poses
    np.testing.assert_allclose(nerfstudio.read(out).poses, expected, atol=1e-9)
    assert faults.exit_code(camera_path.main, [*words, "--data", str(saved)]) == 1
    assert "--data goes with --dataparser" in capsys.readouterr().err


def test_one_camera_is_refused_by_name(tmp_path, capsys):
    folder = scene_of(tmp_path / "scene", captures.ring(1), split=["train"])
    out = tmp_path / "camera_path.json"
    words = ["--scene", str(folder), "--out", str(out)]
    assert faults.exit_code(camera_path.main, words) == 1
    said = capsys.readouterr().err
    assert said == f"error: {folder}/cameras.npz: one camera makes no path\n"
    assert not out.exists()


def test_the_tiny_scene_has_a_path(tmp_path):
    path = camera_path.of_scene(job_cases.make_scene(tmp_path))
    assert (path.width, path.height) == (job_cases.WIDTH, job_cases.HEIGHT)
