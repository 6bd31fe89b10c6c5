"""Scenes with known cameras, and the lens distortion that they name."""

import json
import re
import shutil
import time

import numpy as np
import pytest
from PIL import Image

from alignerf.experiment.checks import scenes as of_scenes
from alignerf.io import images
from alignerf.judged import camera_files
from alignerf.judged import views as judged
from alignerf.readers import transforms
from alignerf.scenes import distortion, prepare, prepared
from tests import camera_twins

LENSES = [
    np.array([0.0, 0.0, 0.0, 0.0, 0.0]),
    np.array([0.06, -0.08, -1e-3, 1.6e-4, 0.0]),
    np.array([-0.2, 0.05, 0.0, 0.0, 0.0]),
    np.array([-0.1, 0.02, 2e-3, -3e-3, 1e-3]),
]
CAMTOPIX = np.array([[70.0, 0, 47.3], [0, 72.0, 33.9], [0, 0, 1]])
WIDTH, HEIGHT = 96, 64


def test_distortion_of_a_thousand_lenses(rng):
    """From the middle to far beyond the photo, each point through its own lens."""
    lenses = rng.normal(size=(1000, 5)) * [0.2, 0.1, 0.01, 0.01, 0.05]
    points = rng.normal(size=(1000, 2)) * 10 ** rng.uniform(-6, 0.5, (1000, 1))
    for lens, (x, y) in zip(lenses, points, strict=True):
        found = distortion.distort_points([[x, y]], CAMTOPIX, lens)[0]
        wanted = camera_twins.distorted(x, y, *lens) * np.array([70, 72]) + [47.3, 33.9]
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("lens", LENSES)
def test_pinhole_view_fits_tightly_inside_the_photo(lens):
    pinhole = distortion.pinhole_camera(CAMTOPIX, lens, WIDTH, HEIGHT)
    inverse = np.linalg.inv(pinhole)
    # Pixel shape is kept.
    assert pinhole[0, 0] / pinhole[1, 1] == pytest.approx(70 / 72)
    slack = []
    for side in distortion._border(WIDTH, HEIGHT):
        points = side @ inverse[:2, :2].T + inverse[:2, 2]
        pixels = distortion.distort_points(points, CAMTOPIX, lens)
        room = np.concatenate([pixels, [WIDTH, HEIGHT] - pixels], axis=-1)
        assert room.min() > 0.45
        slack.append(room.min() - 0.5)
    assert min(slack) < 0.2


def pose(rng):
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, rng.normal(size=3)
    return matrix


@pytest.fixture
def scene(tmp_path):
    """A folder with three images of 96x64 and the json that describes four."""
    rng = np.random.default_rng(1)
    (tmp_path / "images").mkdir()
    content = {"fl_x": 70.0, "fl_y": 72.0, "cx": 47.3, "cy": 33.9, "frames": []}
    for name in ("c.png", "a.png", "b.png", "gone.png"):
        if name != "gone.png":
            image = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
            Image.fromarray(image).save(tmp_path / "images" / name)
        frame = {"file_path": f"images/{name}", "transform_matrix": pose(rng).tolist()}
        content["frames"].append(frame)
    return tmp_path, content


def read(scene):
    folder, content = scene
    (folder / "transforms.json").write_text(json.dumps(content))
    return transforms.read(folder)


def test_scaled_rotations_are_set_right_or_refused_wherever_they_are_read(
    scene, caplog
):
    exact = read(scene)[0].camtoworlds
    path = scene[0] / "transforms.json"

    def by(times):
        for frame in scene[1]["frames"]:
            matrix = np.array(frame["transform_matrix"]) @ np.diag([*[times] * 3, 1])
            frame["transform_matrix"] = matrix.tolist()
        path.write_text(json.dumps(scene[1]))

    by(1.03)
    np.testing.assert_allclose(transforms.read(path)[0].camtoworlds, exact, atol=1e-9)
    judged = camera_files.read(path).shots
    np.testing.assert_allclose(judged[0].pose, exact[0], atol=1e-9)
    assert caplog.text.count("by 3 %: the nearest are taken") == 2
    by(2)
    for reader in (transforms.read, camera_files.read):
        with pytest.raises(ValueError, match=r"json: its .* scaled by 2\.06: divide"):
            reader(path)


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("images/c.png", "transform_matrix"),
        ("images/c", "transform_matrix"),
        (r".\images\c.png", "fl_x"),
        ("other/c.png", "transform_matrix"),
    ],
)
def test_two_cameras_never_have_one_photo(scene, name, key, caplog, rng):
    exact = read(scene)[0].camtoworlds
    first, path = scene[1]["frames"][0], scene[0] / "transforms.json"
    (scene[0] / "other").symlink_to(scene[0] / "images")
    again = {**first, "file_path": name}
    lost = {**again, "transform_matrix": None}
    scene[1]["frames"] = [lost, *scene[1]["frames"], again, lost]
    views, left_out = read(scene)
    np.testing.assert_array_equal(views.camtoworlds, exact)
    assert left_out == ["gone"]
    assert f"are there twice: the first is taken: {name}" in caplog.text
    again[key] = pose(rng).tolist() if key == "transform_matrix" else 71.0
    both = f"one photo at two poses: images/c.png and {re.escape(name)}"
    with pytest.raises(ValueError, match=both):
        read(scene)
    scene[1]["frames"] = scene[1]["frames"][1:-1]
    path.write_text(json.dumps(scene[1]))
    if name == first["file_path"]:
        with pytest.raises(ValueError, match="one photo at two poses"):
            judged.taken(scene[0], path)


def test_cameras_are_read_as_written(scene, caplog):
    views, left_out = read(scene)
    views = prepare.sort_by_name(views)
    assert views.names == ["a", "b", "c"]
    assert left_out == ["gone"]
    assert "no photo of 1 of 4 cameras" in caplog.text
    assert "gone.png" in caplog.text
    np.testing.assert_allclose(np.linalg.inv(views.pixtocams[0]), CAMTOPIX)
    for i, frame in enumerate([1, 2, 0]):
        matrix = np.array(scene[1]["frames"][frame]["transform_matrix"])
        np.testing.assert_allclose(views.camtoworlds[i], matrix[:3], atol=1e-9)
        stored = images.read(scene[0] / scene[1]["frames"][frame]["file_path"])
        np.testing.assert_array_equal(views.photos[i].read(), stored)


@pytest.mark.parametrize("folder", ["images_2", "images_10"])
def test_smaller_photos_are_read_where_the_others_are_not_there(scene, folder):
    """As nerfstudio lays them, and people delete the large ones."""
    _shrink(scene[0] / "images", scene[0] / folder)
    shutil.rmtree(scene[0] / "images")
    if folder != "images_2":
        # Its number does not say how much smaller they are.
        scene[1].update(w=WIDTH, h=HEIGHT)
    (scene[0] / "images_x").mkdir()
    views, left_out = read(scene)
    assert (views.width, views.height) == (WIDTH // 2, HEIGHT // 2)
    assert left_out == ["gone"]
    wanted = np.diag([0.5, 0.5, 1]) @ CAMTOPIX
    np.testing.assert_allclose(np.linalg.inv(views.pixtocams[0]), wanted)


def test_a_number_chooses_among_the_folders_of_photos(scene):
    folder, content = scene
    _shrink(folder / "images", folder / "images_2")
    _shrink(folder / "images", folder / "masks_2")
    for frame in content["frames"]:
        frame["mask_path"] = frame["file_path"].replace("images", "masks")
    content["train_filenames"] = ["images/c.png", "images/b.png"]
    content["test_filenames"] = ["images/a.png"]
    content["applied_transform"] = np.eye(4)[[0, 2, 1]].tolist()
    content["ply_file_path"] = "sparse_pc.ply"
    (folder / "transforms.json").write_text(json.dumps(content))
    views = prepare.sort_by_name(transforms.read(folder, images=2)[0])
    assert (views.width, views.height) == (WIDTH // 2, HEIGHT // 2)
    assert views.split.tolist() == ["test", "train", "train"]
    assert views.masks[0].read().shape == (HEIGHT // 2, WIDTH // 2, 3)
    # Poses of the file have its transform already.
    pose_of_a = np.array(content["frames"][1]["transform_matrix"])[:3]
    np.testing.assert_allclose(views.camtoworlds[0], pose_of_a, atol=1e-9)
    with pytest.raises(ValueError, match=r"images_4: no photo images/a\.png"):
        transforms.read(folder, images=4)
    config = {"source": "transforms", "path": str(folder), "images": 2}
    assert of_scenes.checked(config).images == 2
    with pytest.raises(ValueError, match="images"):
        of_scenes.checked(config | {"source": "polycam"})


def _shrink(folder, smaller):
    smaller.mkdir()
    for path in folder.iterdir():
        Image.open(path).resize((WIDTH // 2, HEIGHT // 2)).save(smaller / path.name)


def test_field_of_view_and_paths_without_suffix(scene):
    _, content = scene
    for key in ("fl_x", "fl_y", "cx", "cy"):
        del content[key]
    content["camera_angle_x"] = 2 * np.arctan(0.5)
    for frame in content["frames"]:
        frame["file_path"] = "./" + frame["file_path"].removesuffix(".png")
    views, _ = read(scene)
    expected = [[WIDTH, 0, WIDTH / 2], [0, WIDTH, HEIGHT / 2], [0, 0, 1]]
    np.testing.assert_allclose(np.linalg.inv(views.pixtocams[2]), expected)


def test_frames_have_their_own_lenses_and_size(scene):
    _, content = scene
    content["frames"][1] |= {"fl_x": 140.0, "fl_y": 144.0, "cx": 94.6, "cy": 67.8}
    content["frames"][1] |= {"w": 2 * WIDTH, "h": 2 * HEIGHT}
    content["frames"][2] |= {"k1": -0.2}
    views, _ = read(scene)
    np.testing.assert_allclose(views.pixtocams[1], views.pixtocams[0])
    assert np.abs(views.pixtocams[2] - views.pixtocams[0]).max() > 1e-4


def test_the_files_own_split_is_kept(scene, caplog):
    """Nerfstudio's lists: what neither trains nor is scored is left out, by name."""
    _, content = scene
    content["train_filenames"] = ["./images/c.png", "images/gone.png"]
    content["test_filenames"] = ["images/a.png"]
    views, left_out = read(scene)
    views = prepare.sort_by_name(views)
    assert (views.names, views.split.tolist()) == (["a", "c"], ["test", "train"])
    assert left_out == ["b", "gone"]
    assert "neither trained on nor scored: b" in caplog.text
    assert "no photo of 1 of 4 cameras: images/gone.png" in caplog.text
    # A photo that is to be scored needs a pose.
    frame = next(one for one in content["frames"] if one["file_path"] == "images/a.png")
    pose = frame.pop("transform_matrix")
    with pytest.raises(ValueError, match=r"images/a.png is to be scored, without pose"):
        read(scene)
    frame["transform_matrix"] = pose
    # One list alone says nothing of the rest.
    del content["train_filenames"]
    views, left_out = read(scene)
    assert views.split is None
    assert left_out == ["gone"]


@pytest.mark.parametrize("name", ["images/a", "images\\a.png", "./images/x/../a.png"])
def test_lists_find_their_frames_however_these_are_written(scene, name):
    scene[1].update(train_filenames=["images/b", "images/c"], test_filenames=[name])
    views = prepare.sort_by_name(read(scene)[0])
    assert views.split.tolist() == ["test", "train", "train"]


@pytest.mark.parametrize(
    ("test", "named"),
    [
        (["images/gone.png"], "no photo images/gone.png"),
        (["images/c.png"], "c.png is to be trained on and scored"),
        ("images/a.png", "test_filenames"),
        ([1], "test_filenames"),
    ],
)
def test_faults_of_a_split_are_named(scene, test, named):
    scene[1].update(train_filenames=["images/c.png"], test_filenames=test)
    with pytest.raises(ValueError, match=named) as caught:
        read(scene)
    assert "transforms.json" in str(caught.value)


def change(content, path, value):
    *parents, key = path
    for parent in parents:
        content = content[parent]
    if value is None:
        del content[key]
    else:
        content[key] = value


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (["frames"], None, "frames"),
        (["frames"], [], "no camera has a pose"),
        (["frames", 0], "text", r"frames\[0\]"),
        (["frames", 0, "file_path"], None, "file_path"),
        (["frames", 0, "transform_matrix"], [[1, 2], [3]], "transform_matrix"),
        (["frames", 0, "transform_matrix"], np.diag([0, 0, 0, 1]).tolist(), "rotation"),
        (["frames", 0, "w"], 64, "'w' and 'h' alone"),
        (["frames", 0, "h"], -64, "'w' and 'h' alone"),
        (["fl_x"], None, "fl_x"),
        (["fl_x"], "70", "fl_x"),
        (["fl_x"], -70.0, "fl_x"),
        (["k1"], float("inf"), "k1"),
        (["k1"], -3.0, "distortion"),
        (["fl_x"], 10**400, "fl_x"),
        (["cx"], 1e308, "cx"),
        (["frames", 0, "transform_matrix", 0, 0], 10**400, "transform_matrix"),
        (["k4"], 0.1, "k4"),
        (["camera_model"], "EQUIRECTANGULAR", "EQUIRECTANGULAR"),
        (["camera_model"], ["OPENCV"], "camera_model"),
        (["is_fisheye"], "false", "is_fisheye"),
        (["fl_x"], 0, "no lens has its 'fl_x', 0"),
        (["fl_y"], 0, "no lens has its 'fl_y', 0"),
        (["fl_y"], -1.5, "no lens has its 'fl_y'"),
        (["fl_y"], 5e-324, "no lens has its 'fl_y'"),
        (["fl_x"], True, "fl_x is True"),
        (["frames", 0, "transform_matrix", 3], [0, 0, 0, 2], "last row"),
        (["frames", 0, "transform_matrix", 3], [0, 0, 1, 0], "last row"),
        (["frames", 0, "transform_matrix"], 1.5, "transform_matrix"),
    ],
)
def test_faults_are_named(scene, path, value, named):
    change(scene[1], path, value)
    with pytest.raises(ValueError, match=named) as caught:
        read(scene)
    assert "transforms.json" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("angle", [5e-324, 0, -1.0, 3.2, 1e-300, 1e-7, 3.1415926535])
def test_a_field_of_view_that_no_lens_has_is_named(scene, axis, angle):
    if axis == "x":
        del scene[1]["fl_x"]
    del scene[1]["fl_y"]
    scene[1][f"camera_angle_{axis}"] = angle
    with pytest.raises(
        ValueError, match=rf"\.json: .*'camera_angle_{axis}', "
    ) as found:
        read(scene)
    assert len(str(found.value)) < 300


def test_files_that_are_no_scene(tmp_path, scene):
    with pytest.raises(ValueError, match=r"transforms\.json"):
        transforms.read(tmp_path)
    for text in ("", "[1]", '{"frames"', "\xff"):
        (tmp_path / "t.json").write_text(text)
        with pytest.raises(ValueError, match=r"t\.json"):
            transforms.read(tmp_path / "t.json")
    for name in ("a.png", "b.png", "c.png"):
        (tmp_path / "images" / name).unlink()
    with pytest.raises(ValueError, match="no photo images/c"):
        read(scene)


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (["fl_x"], 1e29, "no lens has"),
        (["fl_x"], 1e-20, "no lens has"),
        (["cx"], 1e20, "principal point"),
        (["frames", 0, "transform_matrix", 0, 3], 1e200, "not finite"),
    ],
)
def test_cameras_that_see_nothing_are_refused_with_the_file(scene, path, value, named):
    """By stage `poses`, of every source."""
    change(scene[1], path, value)
    with pytest.raises(ValueError, match=named):
        prepared.check_views(scene[0], read(scene)[0])


def test_many_frames_without_an_image_take_seconds(scene):
    frame = scene[1]["frames"][0]
    more = [frame | {"file_path": f"images/no{i}"} for i in range(19_996)]
    scene[1]["frames"] += more
    started = time.process_time()
    with pytest.raises(ValueError, match=r"no photo images/gone\.png.*19994 more"):
        read(scene)
    assert time.process_time() - started < 20


@pytest.mark.whole
def test_fox(shared_data):
    views, left_out = transforms.read(shared_data / "scenes" / "fox")
    assert len(views.names) == 50
    assert len(left_out) == 17
    assert (views.width, views.height) == (1080, 1920)
    small = prepare.downscale(views, 4)
    assert small.photos[0].read().shape == (480, 270, 3)
