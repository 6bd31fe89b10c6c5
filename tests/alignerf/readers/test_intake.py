"""Folders as people have them: names, models, files, sizes, masks of public reports."""

import json
import math
import shutil

import numpy as np
import pycolmap
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from alignerf.captures import base, typed
from alignerf.cli import folders
from alignerf.colmap import ingest
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.judged import views as judged

WIDTH, HEIGHT, COUNT = 60, 40, 6
LENS = {"fl_x": 70.0, "fl_y": 70.0, "cx": 31.0, "cy": 19.0, "w": WIDTH, "h": HEIGHT}
# Seen by all cameras.
POINT = np.array([0.1, -0.2, 0.3])


def pose(i):
    """Camera-to-world [4, 4], OpenGL axes, on an arc around the origin."""
    turn = Rotation.from_euler("y", 0.2 * i - 0.5).as_matrix()
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, turn @ [0, 0, 4]
    return matrix


def write_photos(folder, name="{}.jpg", size=(WIDTH, HEIGHT), numbers=range(COUNT)):
    for i in numbers:
        path = folder / name.format(i)
        path.parent.mkdir(parents=True, exist_ok=True)
        noise = np.random.default_rng(i).integers(0, 256, (*size[::-1], 3), np.uint8)
        Image.fromarray(noise).save(path)


def write_transforms(folder, name="images/{}.jpg", lens=LENS, **keys):
    folder.mkdir(parents=True, exist_ok=True)
    frames = [
        {"file_path": name.format(i), "transform_matrix": pose(i).tolist()}
        for i in range(COUNT)
    ]
    content = lens | keys | {"frames": frames}
    (folder / "transforms.json").write_text(json.dumps(content))
    return content


def rewrite(folder, content):
    (folder / "transforms.json").write_text(json.dumps(content))


def write_model(folder, name="{}.jpg", numbers=range(COUNT), size=(WIDTH, HEIGHT)):
    """COLMAP's texts of a pinhole."""
    folder.mkdir(parents=True)
    params = f"{LENS['fl_x']} {LENS['fl_y']} {LENS['cx']} {LENS['cy']}"
    camera = f"1 PINHOLE {size[0]} {size[1]} {params}\n"
    (folder / "cameras.txt").write_text(camera)
    lines = []
    for i in numbers:
        matrix = np.linalg.inv(pose(i) @ np.diag([1.0, -1, -1, 1]))
        turn = Rotation.from_matrix(matrix[:3, :3])
        quaternion = turn.as_quat(scalar_first=True)
        numbers_of = [*quaternion, *matrix[:3, 3]]
        lines += [
            f"{i + 1} {' '.join(map(repr, map(float, numbers_of)))} 1 {name.format(i)}",
            "",
        ]
    (folder / "images.txt").write_text("\n".join([*lines, ""]))
    (folder / "points3D.txt").write_text("")


def read(folder):
    """(source, views, left out) as the program finds them."""
    capture = base.detected(folder)
    views, left_out = capture.read_given(of_scenes.checked(capture.scene(folder)))
    return capture.name, views, left_out


def check_seen(views, camera_of=range(COUNT)):
    """Each view sees the point where its camera, at its photo's size, sees it."""
    for view, i in enumerate(camera_of):
        camtopix = np.linalg.inv(views.pixtocams[view])
        found, expected = (
            seen_by(matrix, camtopix)
            for matrix in (views.camtoworlds[view], pose(i)[:3])
        )
        np.testing.assert_allclose(found, expected, atol=1e-6)
        assert views.photos[view].read().shape == (views.height, views.width, 3)


def seen_by(camtoworld, camtopix):
    x, y, z = (POINT - camtoworld[:, 3]) @ camtoworld[:, :3]
    return (camtopix @ [x / -z, -y / -z, 1])[:2]


NAMES = {
    "absolute, of another machine": ("C:/Users/me/scan/images/{}.jpg", "images/{}.jpg"),
    "backslashes": (r".\images\{}.jpg", "images/{}.jpg"),
    "a folder beside": ("../scan/images/{}.jpg", "images/{}.jpg"),
    "another suffix": ("images/{}.png", "images/{}.jpg"),
    "another case": ("Images/{}.JPG", "images/{}.jpg"),
    "none": ("images/{}", "images/{}.jpg"),
    "another folder": ("images/{}.jpg", "frames/{}.jpg"),
    "bare": ("{}.jpg", "input/{}.jpg"),
    "spaces": ("images/my photo ({}).jpg", "images/my photo ({}).jpg"),
    "a camera's folder": ("images/cam0/{}.jpg", "images/cam0/{}.jpg"),
}


@pytest.mark.parametrize(("name", "path"), NAMES.values(), ids=NAMES)
def test_a_json_names_photos_by_any_path(tmp_path, name, path):
    write_photos(tmp_path, path)
    write_transforms(tmp_path, name)
    source, views, left_out = read(tmp_path)
    assert (source, len(views.names), left_out) == ("transforms", COUNT, [])
    assert [one.path for one in views.photos] == [
        tmp_path / path.format(i) for i in range(COUNT)
    ]
    check_seen(views)


@pytest.mark.parametrize(("name", "path"), NAMES.values(), ids=NAMES)
def test_a_model_names_photos_by_any_path(tmp_path, name, path):
    write_photos(tmp_path, path)
    write_model(tmp_path / "sparse/0", name)
    source, views, left_out = read(tmp_path)
    assert (source, len(views.names), left_out) == ("mipnerf360", COUNT, [])
    check_seen(views)


def test_photos_of_one_name_in_two_folders_are_two_views(tmp_path):
    for way in ("json", "model"):
        folder = tmp_path / way
        # Views 0 to 5 as 0 to 2 of two cameras.
        for i in range(COUNT):
            write_photos(
                folder / f"images/cam{i // 3}", f"{i % 3:04d}.jpg", numbers=[i]
            )
        if way == "json":
            content = write_transforms(folder)
            for i, frame in enumerate(content["frames"]):
                frame["file_path"] = f"images/cam{i // 3}/{i % 3:04d}.jpg"
            rewrite(folder, content)
        else:
            write_model(folder / "sparse/0")
            texts = folder / "sparse/0/images.txt"
            text = texts.read_text()
            for i in range(COUNT):
                text = text.replace(f" {i}.jpg", f" cam{i // 3}/{i % 3:04d}.jpg")
            texts.write_text(text)
        _, views, _ = read(folder)
        assert views.names[:4] == ["cam0_0000", "cam0_0001", "cam0_0002", "cam1_0000"]
        check_seen(views)


def test_photos_alone_in_a_folder_of_each_camera_are_one_scene(tmp_path):
    write_photos(tmp_path / "images/cam0", numbers=range(3))
    write_photos(tmp_path / "images/cam1", numbers=range(1, 4))
    write_photos(tmp_path / "images/cam1", "{}.jpg", numbers=[7])
    capture = base.detected(tmp_path)
    assert capture.name == "photos"
    scene = capture.scene(tmp_path)
    (tmp_path / "work").mkdir()
    taken = ingest.ingest(scene["path"], tmp_path / "work")
    # Those of one content are the same photo again.
    assert taken.names == ["0", "3", "7", "cam0_1", "cam0_2"]
    assert len(set(taken.cameras.tolist())) == 2


@pytest.mark.parametrize("source", ["transforms", "mipnerf360"])
def test_photos_that_were_sorted_out_are_left_out_until_too_many(
    tmp_path, source, caplog
):
    write_photos(tmp_path / "images", numbers=range(1, COUNT))
    if source == "transforms":
        write_transforms(tmp_path)
    else:
        write_model(tmp_path / "sparse/0")
    _, views, _ = read(tmp_path)
    assert views.names == ["1", "2", "3", "4", "5"]
    assert "0.jpg" in caplog.text
    check_seen(views, range(1, COUNT))
    if source == "mipnerf360":
        for i in (1, 2):
            (tmp_path / f"images/{i}.jpg").unlink()
        with pytest.raises(
            ValueError, match=r"images: no photo 0\.jpg, 1\.jpg, 2\.jpg"
        ):
            read(tmp_path)


def test_a_photo_of_another_folder_is_not_taken_for_one_that_is_gone(tmp_path):
    write_photos(tmp_path / "images", numbers=range(1, COUNT))
    write_photos(tmp_path / "blurred", numbers=[0])
    write_transforms(tmp_path)
    assert read(tmp_path)[1].names == ["1", "2", "3", "4", "5"]


@pytest.mark.parametrize(
    ("models", "photos", "taken"),
    [
        ({"sparse/0": 3, "models/1": 6}, "images", "models/1"),
        ({"sparse/0": 3, "sparse/1": 6}, "images", "sparse/1"),
        ({"dense/sparse": 6}, "dense/images", "dense/sparse"),
        ({"dense/sparse/0": 6}, "dense/images", "dense/sparse/0"),
        ({"distorted/sparse/0": 6}, "input", "distorted/sparse/0"),
        ({"colmap/sparse/0": 6}, "images", "colmap/sparse/0"),
        ({"outputs/sfm": 6}, "images", "outputs/sfm"),
        ({"sparse": 6}, "frames", "sparse"),
        ({"sparse/0": 6}, "images_4", "sparse/0"),
        ({"sparse/0": 6}, "my photos", "sparse/0"),
        ({".": 6}, ".", "."),
    ],
)
def test_the_largest_model_of_any_place_is_taken(
    tmp_path, models, photos, taken, caplog
):
    folder = tmp_path / "scan"
    for place, count in models.items():
        write_model(folder / place, numbers=range(count))
    write_photos(folder / photos)
    source, views, _ = read(folder)
    assert (source, len(views.names)) == ("mipnerf360", 6)
    check_seen(views)
    if len(models) > 1:
        assert f"{taken} of 6 images is taken; left: sparse/0 of 3" in caplog.text


def test_a_model_of_other_photos_is_passed_over(tmp_path):
    """Undistorted photos, whose originals have gone."""
    write_model(tmp_path / "sparse/0", "DSC{}.jpg")
    write_model(tmp_path / "dense/sparse", numbers=range(4))
    write_photos(tmp_path / "dense/images", numbers=range(4))
    assert len(read(tmp_path)[1].names) == 4


def test_a_model_without_images_is_none(tmp_path, caplog):
    """LLFF's folders have its cameras alone."""
    write_photos(tmp_path / "images")
    write_model(tmp_path / "sparse/0")
    (tmp_path / "sparse/0/images.txt").unlink()
    rows = np.zeros((COUNT, 17))
    for i in range(COUNT):
        axes = pose(i)[:3, [1, 0, 2, 3]] * [-1, 1, 1, 1]
        size_and_focal = [[HEIGHT], [WIDTH], [LENS["fl_x"]]]
        rows[i] = [*np.hstack([axes, size_and_focal]).ravel(), 1, 10]
    np.save(tmp_path / "poses_bounds.npy", rows)
    _, views, _ = read(tmp_path)
    assert "without images.txt: poses of poses_bounds.npy" in caplog.text
    np.testing.assert_allclose(views.camtoworlds[3], pose(3)[:3], atol=1e-12)


@pytest.mark.parametrize("kind", ["texts", "binaries"])
def test_a_model_without_points_has_cameras(tmp_path, kind):
    write_photos(tmp_path / "images")
    model = tmp_path / "sparse/0"
    write_model(model)
    if kind == "binaries":
        binary = pycolmap.Reconstruction(model)
        shutil.rmtree(model)
        model.mkdir()
        binary.write(model)
    for path in model.glob("points3D.*"):
        path.unlink()
    views = read(tmp_path)[1]
    assert views.points is None
    check_seen(views)


def test_where_colmap_has_failed_is_said(tmp_path):
    write_photos(tmp_path / "images")
    (tmp_path / "sparse/0").mkdir(parents=True)
    with pytest.raises(ValueError, match=r"no COLMAP model in it.*move sparse away"):
        read(tmp_path)


def test_distorted_photos_are_those_of_the_distorted_model(tmp_path):
    """3DGS's convert.py writes undistorted ones of the same names to images/."""
    for name in ("images", "input"):
        write_photos(tmp_path / name)
    write_model(tmp_path / "distorted/sparse/0")
    views = read(tmp_path)[1]
    assert {one.path.parent.name for one in views.photos} == {"input"}


def test_names_of_a_text_are_no_points_of_the_image_above(tmp_path):
    """With nine numbers before, a name of three words makes a line of points."""
    write_photos(tmp_path / "images", "my photo ({}).jpg")
    write_model(tmp_path / "sparse/0", "my photo ({}).jpg")
    path = tmp_path / "sparse/0/images.txt"
    path.write_text(path.read_text().replace("\n\n", "\n"))
    with pytest.raises(ValueError, match=r"line 2: not the points of the image above"):
        read(tmp_path)


def test_photos_as_large_as_their_cameras_are_the_models(tmp_path):
    """Of one name there are originals, whose lens is not undone, too."""
    write_model(tmp_path / "sparse/0")
    write_photos(tmp_path / "images", size=(66, 44))
    assert read(tmp_path)[1].photos[0].path == tmp_path / "images/0.jpg"
    write_photos(tmp_path / "images_undistorted")
    views = read(tmp_path)[1]
    assert views.photos[0].path == tmp_path / "images_undistorted/0.jpg"
    check_seen(views)


def test_a_principal_point_beside_the_photo_is_said(tmp_path, caplog):
    write_photos(tmp_path / "images")
    write_transforms(tmp_path, lens=LENS | {"cx": 62.0})
    read(tmp_path)
    assert "principal point lies beside the photo" in caplog.text
    assert "larger one: 0, 1, 2 and 3 more" in caplog.text


def test_a_view_is_called_after_its_photo(tmp_path):
    write_photos(tmp_path / "images")
    write_model(tmp_path / "sparse/0", r"D:\scan\{}.jpg")
    assert read(tmp_path)[1].names == list("012345")


def test_cameras_among_the_photos_are_taken(tmp_path):
    write_photos(tmp_path / "images")
    write_transforms(tmp_path / "images", "{}.jpg")
    assert typed.meant(tmp_path) == tmp_path / "images"


def test_photos_are_said_to_have_cameras_above(tmp_path, caplog):
    write_photos(tmp_path / "images")
    assert typed.meant(tmp_path / "images") == tmp_path / "images"
    assert not caplog.text
    write_model(tmp_path / "sparse/0")
    assert typed.meant(tmp_path / "images") == tmp_path / "images"
    assert f"give {tmp_path} for the cameras that lie there" in caplog.text


def test_files_as_other_programs_write_them(tmp_path, caplog):
    write_photos(tmp_path / "images")
    content = write_transforms(tmp_path, r".\images\{}.jpg")
    content["frames"][3]["transform_matrix"][1][3] = math.nan
    content["frames"].append(content["frames"][1])
    text = json.dumps(content).replace("}, {", "},\r\n{")
    (tmp_path / "transforms.json").write_bytes(text.encode("utf-8-sig"))
    _, views, left_out = read(tmp_path)
    assert (views.names, left_out) == (["0", "1", "2", "4", "5"], ["3"])
    assert "no pose, or numbers that are none: .\\images\\3.jpg" in caplog.text
    assert "are there twice: the first is taken: .\\images\\1.jpg" in caplog.text
    check_seen(views, [0, 1, 2, 4, 5])


def test_frames_whose_pose_is_null_are_dropped(tmp_path, caplog):
    write_photos(tmp_path / "images")
    content = write_transforms(tmp_path, camera_model="opencv")
    content["frames"][0]["transform_matrix"] = None
    del content["frames"][1]["transform_matrix"]
    rewrite(tmp_path, content)
    views = read(tmp_path)[1]
    assert "have no pose, or numbers that are none: images/0.jpg" in caplog.text
    check_seen(views, [2, 3, 4, 5])


@pytest.mark.parametrize("name", ["../raw/{}.jpg", "{}.jpg"])
def test_photos_outside_of_the_folder_are_said_to_be(tmp_path, name):
    write_photos(tmp_path / "raw")
    write_transforms(tmp_path / "scan", name)
    with pytest.raises(ValueError, match=r"(.*)/scan: no .* so called lie in \1/raw: "):
        read(tmp_path / "scan")
    (tmp_path / "scan/images").symlink_to(tmp_path / "raw")
    check_seen(read(tmp_path / "scan")[1])


def test_where_a_json_has_a_comma_too_many_is_said(tmp_path):
    write_photos(tmp_path / "images")
    write_transforms(tmp_path)
    path = tmp_path / "transforms.json"
    path.write_text(path.read_text()[:-2] + ",\n]}")
    with pytest.raises(ValueError, match=r"transforms\.json: .* line 2 column 1"):
        read(tmp_path)


def test_photos_of_several_sizes_lie_on_one_canvas(tmp_path, caplog):
    write_photos(tmp_path / "images", numbers=range(4))
    write_photos(tmp_path / "images", numbers=[4, 5], size=(80, 60))
    content = write_transforms(tmp_path)
    for frame in content["frames"][4:]:
        frame |= {"fl_x": 90.0, "fl_y": 90.0, "cx": 41.0, "cy": 29.0, "w": 80, "h": 60}
    rewrite(tmp_path, content)
    _, views, _ = read(tmp_path)
    assert (views.width, views.height) == (WIDTH, HEIGHT)
    assert "photos of several sizes: 4 of 60x40, 2 of 80x60" in caplog.text
    check_seen(views)
    focal_px = np.linalg.inv(views.pixtocams)[:, 0, 0]
    np.testing.assert_allclose(focal_px, LENS["fl_x"], rtol=0.01)


def test_a_photo_of_another_shape_has_its_own_numbers(tmp_path):
    """As instant-ngp has them, without w and h."""
    write_photos(tmp_path / "images", numbers=range(5))
    write_photos(tmp_path / "images", numbers=[5], size=(80, 60))
    content = write_transforms(tmp_path, lens=dict(list(LENS.items())[:4]))
    with pytest.raises(ValueError, match=r"5\.jpg is 80x60, which is another shape"):
        read(tmp_path)
    content["frames"][5] |= {"fl_x": 90.0, "fl_y": 90.0, "cx": 41.0, "cy": 29.0}
    rewrite(tmp_path, content)
    check_seen(read(tmp_path)[1])


def test_smaller_photos_of_several_cameras(tmp_path):
    write_photos(tmp_path / "images_2/left", numbers=range(COUNT))
    content = write_transforms(tmp_path, "images/left/{}.jpg")
    content |= {key: 2 * value for key, value in LENS.items()}
    rewrite(tmp_path, content)
    views = read(tmp_path)[1]
    check_seen(views)
    assert views.photos[0].path == tmp_path / "images_2/left/0.jpg"


def test_thumbnails_are_no_photos(tmp_path):
    write_photos(tmp_path / "images", "{}.JPEG")
    write_photos(tmp_path / "thumbnails")
    write_transforms(tmp_path, "{}.jpg")
    views = read(tmp_path)[1]
    assert {one.path.parent.name for one in views.photos} == {"images"}


@pytest.mark.parametrize("times", [2, 4, 8, 0.5, 0.25, 0.125])
@pytest.mark.parametrize("size", ["theirs", "the photo's", "none"])
def test_numbers_of_photos_of_another_size_are_told(tmp_path, times, size, caplog):
    caplog.set_level("INFO")
    write_photos(tmp_path / "images")
    large = {key: times * value for key, value in LENS.items()}
    own = {"theirs": {}, "the photo's": {"w": WIDTH, "h": HEIGHT}, "none": {}}[size]
    large = large if size != "none" else dict(list(large.items())[:4])
    write_transforms(tmp_path, lens=large | own)
    _, views, _ = read(tmp_path)
    expected = [[70, 0, 31], [0, 70, 19], [0, 0, 1]]
    np.testing.assert_allclose(np.linalg.inv(views.pixtocams[0]), expected)
    assert f"cameras of photos {times} times as large" in caplog.text


@pytest.mark.parametrize("source", ["transforms", "mipnerf360"])
@pytest.mark.parametrize("times", [1, 2, 0.25])
@pytest.mark.parametrize("is_stated", [False, True])
def test_a_judgement_has_the_cameras_of_a_training(tmp_path, source, times, is_stated):
    """Also of a file whose numbers are not of the size that it says."""
    write_photos(tmp_path / "images")
    if source == "transforms":
        lens = {key: times * value for key, value in LENS.items()}
        lens |= {} if is_stated else {"w": WIDTH, "h": HEIGHT}
        write_transforms(tmp_path, lens=lens)
    else:
        size = (round(times * WIDTH), round(times * HEIGHT))
        write_model(tmp_path / "sparse/0", size=size if is_stated else (WIDTH, HEIGHT))
    _, views, _ = read(tmp_path)
    found = judged.taken(tmp_path / "images", tmp_path).shots
    assert [shot.name for shot in found] == views.names
    for shot, pose_of, pixtocam in zip(
        found, views.camtoworlds, views.pixtocams, strict=True
    ):
        np.testing.assert_array_equal(shot.pose, pose_of)
        lens, _ = shot.at((WIDTH, HEIGHT), shot.name)
        np.testing.assert_allclose(lens, np.linalg.inv(pixtocam))


def test_a_crop_among_others_is_not_taken_for_numbers_of_a_smaller_photo(tmp_path):
    write_photos(tmp_path / "images")
    content = write_transforms(tmp_path)
    content["frames"][0] |= {"cx": WIDTH / 4, "cy": HEIGHT / 4}
    rewrite(tmp_path, content)
    lens = np.linalg.inv(read(tmp_path)[1].pixtocams[0])
    np.testing.assert_allclose(lens, [[70, 0, 15], [0, 70, 10], [0, 0, 1]], atol=1e-9)


def test_cameras_of_photos_turned_upright_are_taken_where_exif_says_so(
    tmp_path, caplog
):
    write_photos(tmp_path / "images", size=(HEIGHT, WIDTH))
    write_transforms(tmp_path)
    with pytest.raises(ValueError, match="turned against each other"):
        read(tmp_path)
    exif = Image.Exif()
    exif[0x0112] = 6
    for path in (tmp_path / "images").iterdir():
        with Image.open(path) as image:
            image.save(path, exif=exif)
    _, views, _ = read(tmp_path)
    assert "cameras of photos turned upright, as EXIF says: 0, 1, 2" in caplog.text
    check_seen(views)


def test_a_crop_is_refused(tmp_path):
    write_photos(tmp_path / "images", size=(WIDTH, WIDTH))
    write_transforms(tmp_path)
    with pytest.raises(ValueError, match="another shape than its camera's"):
        read(tmp_path)


def write_masks(
    folder, name="{}.jpg.png", value=255, size=(WIDTH, HEIGHT), numbers=range(COUNT)
):
    folder.mkdir()
    for i in numbers:
        mask = np.full(size[::-1], value, np.uint8)
        mask[:, : size[0] // 4] = 255 - value
        Image.fromarray(mask).save(folder / name.format(i))


@pytest.mark.parametrize("source", ["transforms", "mipnerf360"])
@pytest.mark.parametrize("name", ["{}.jpg.png", "{}.png", "{}.JPG.png"])
@pytest.mark.parametrize("times", [1, 2])
def test_masks_count_with_given_cameras(tmp_path, source, name, times):
    write_photos(tmp_path / "images")
    if source == "transforms":
        write_transforms(tmp_path)
    else:
        write_model(tmp_path / "sparse/0")
    write_masks(tmp_path / "masks", name, size=(times * WIDTH, times * HEIGHT))
    _, views, _ = read(tmp_path)
    for mask in views.masks:
        counts = mask.read().min(axis=-1)
        assert (counts[:, : WIDTH // 4] == 0).all()
        assert (counts[:, WIDTH // 4 :] == 255).all()


@pytest.mark.parametrize(
    ("name", "photos"),
    [
        ("/home/me/scan/masks/{}.png", "images"),
        (r".\masks\{}.PNG", "images"),
        ("masks/{}.png", "images_2"),
    ],
)
def test_a_json_names_masks_by_any_path(tmp_path, name, photos):
    write_photos(tmp_path / photos)
    content = write_transforms(tmp_path)
    write_masks(tmp_path / "masks", "{}.png")
    for i, frame in enumerate(content["frames"]):
        frame["mask_path"] = name.format(i)
    rewrite(tmp_path, content)
    views = read(tmp_path)[1]
    paths = [tmp_path / f"masks/{i}.png" for i in range(COUNT)]
    assert [one.path for one in views.masks] == paths
    # No photo is one.
    shutil.rmtree(tmp_path / "masks")
    with pytest.raises(ValueError, match="no mask"):
        read(tmp_path)


def test_masks_of_another_suffix_and_folder_are_said(tmp_path, caplog):
    write_photos(tmp_path / "images")
    write_transforms(tmp_path)
    write_masks(tmp_path / "mask", "{}.jpg")
    folders.scenes_of(tmp_path)
    assert "mask: not looked through for masks" in caplog.text
    (tmp_path / "mask").rename(tmp_path / "masks")
    with pytest.raises(ValueError, match=r"no mask .*: save 0\.jpg as \.png"):
        read(tmp_path)


def test_inverted_masks_and_photos_without_one_are_said(tmp_path, caplog):
    write_photos(tmp_path / "images")
    write_transforms(tmp_path)
    write_masks(tmp_path / "masks", value=0, numbers=range(4))
    for path in (tmp_path / "masks").iterdir():
        mask = np.zeros((HEIGHT, WIDTH), np.uint8)
        mask[:5] = 255
        Image.fromarray(mask).save(path)
    _, views, _ = read(tmp_path)
    assert "masks hide 88 % of their photos" in caplog.text
    assert "no mask of images/4.jpg, images/5.jpg: all of it" in caplog.text
    assert (views.masks[5].read() == 255).all()


def test_a_mask_of_another_shape_is_named(tmp_path):
    write_photos(tmp_path / "images")
    write_transforms(tmp_path)
    write_masks(tmp_path / "masks", size=(WIDTH, WIDTH))
    views = read(tmp_path)[1]
    with pytest.raises(ValueError, match=r"0\.jpg\.png is 60x60, its photo 60x40"):
        views.masks[0].read()
