"""Photos, renders and cameras put together."""

import json

import numpy as np
import pytest
from PIL import Image

from alignerf import poses
from alignerf.captures import base
from alignerf.external import render
from alignerf.judged import views
from alignerf.scenes import prepared
from tests import judged_cases as cases


@pytest.fixture(autouse=True)
def unmatched(monkeypatch):
    """Cameras are checked in the tests of `judge`: that takes most of the time."""
    record = base.every()["external_renders"]
    monkeypatch.setattr(type(record), "wants_matches", lambda self, config: False)


def prepare(folder, config):
    poses.main(config, folder / "scene")
    return folder / "scene"


def run(scene, splits=("train",)):
    """The importer's outputs beside a scene."""
    out = scene / "theirs"
    out.mkdir()
    paths = [f"--{n}={out}/{n}" for n in ("renders", "depth", "timing")]
    render.main([f"--scene={scene}", "--splits", *splits, *paths])
    return out


@pytest.mark.parametrize("way", ["taken", "kept", "opencv", "pinhole", "colmap"])
def test_photos_become_what_renders_show(tmp_path, way):
    """Of renders that are exact but for resampling, pairs are alike in all ways."""
    scene = prepare(tmp_path, cases.project(tmp_path, way))
    told = json.loads((scene / "poses.json").read_text())
    assert told["external_renders"]["way"] == way
    assert told["external_renders"]["depth"] == "far"
    out = run(scene)
    loaded = prepared.load(scene)
    train = loaded.views("train")
    photos = prepared.read_images(loaded, train, scene / "images").astype(float)
    renders = prepared.read_images(loaded, train, out / "renders" / "train")
    masks = prepared.read_masks(loaded, train)
    assert masks.mean() > 0.8
    assert np.abs(photos - renders)[masks].mean() < 2.5
    np.testing.assert_allclose(
        np.linalg.inv(loaded.pixtocams[0]), cases.shown(way).camtopix, rtol=1e-9
    )
    with np.load(out / "depth" / "train" / "v00.npz") as data:
        assert np.isinf(data["depth"]).all()


def test_borders_and_alpha_do_not_count(tmp_path):
    """A render's black border, and what is transparent; black things inside do."""
    config = cases.project(tmp_path)
    path = tmp_path / "renders" / "v03.png"
    image = np.asarray(Image.open(path)).copy()
    image[:10] = 0
    image[50:60, 50:60] = 0
    Image.fromarray(image).save(path)
    alpha = np.full((*image.shape[:2], 1), 255, np.uint8)
    alpha[:, -20:] = 0
    clear = tmp_path / "renders" / "v04.png"
    rgba = np.concatenate([np.asarray(Image.open(clear)), alpha], axis=-1)
    Image.fromarray(rgba).save(clear)
    scene = prepare(tmp_path, config)
    loaded = prepared.load(scene)
    masks = dict(zip(loaded.names, prepared.read_masks(loaded, range(8)), strict=True))
    assert masks["v03"][:6].sum() == 0
    assert masks["v03"][52:58, 52:58].all()
    assert masks["v04"][:, -15:].sum() == 0
    assert masks["v04"][:, :120].all()


def with_hole(path, rows=slice(50, 60)):
    """A file's image, transparent in a square inside."""
    image = np.asarray(Image.open(path).convert("RGB"))
    alpha = np.full((*image.shape[:2], 1), 255, np.uint8)
    alpha[rows, 50:60] = 0
    Image.fromarray(np.concatenate([image, alpha], axis=-1)).save(path)


def test_transparent_holes_do_not_count_or_show_the_background(tmp_path):
    """A hole reaches no edge; with a background photo and render have it alike."""
    config = cases.project(tmp_path)
    with_hole(tmp_path / "renders" / "v03.png")
    scene = prepare(tmp_path, config)
    loaded = prepared.load(scene)
    (mask,) = prepared.read_masks(loaded, [3])
    assert not mask[52:58, 52:58].any()
    with_hole(tmp_path / "photos" / "v03.png")
    (tmp_path / "white").mkdir()
    scene = prepare(
        tmp_path / "white", config.model_copy(update={"background": "white"})
    )
    (mask,) = prepared.read_masks(prepared.load(scene), [3])
    assert mask[52:58, 52:58].all()
    out = run(scene)
    for folder in (scene / "images", out / "renders" / "train"):
        image = np.asarray(Image.open(folder / "v03.png"))
        assert (image[54:56, 54:56] > 250).all()


def test_an_empty_render_is_named(tmp_path):
    config = cases.project(tmp_path)
    path = tmp_path / "renders" / "v03.png"
    cases.write_png(path, np.zeros((120, 160, 3), np.uint8))
    with pytest.raises(ValueError, match=r"renders/v03.png: an empty image"):
        prepare(tmp_path, config)


def test_a_sheet_has_two_halves(tmp_path):
    config = cases.project(tmp_path)
    for i, name in enumerate(cases.NAMES):
        (tmp_path / "renders" / f"{name}.png").unlink()
        sheet = np.hstack([cases.picture(i), cases.picture(i)])[:, 1:]
        cases.write_png(tmp_path / "renders" / f"val_step9_{i:04}.png", sheet)
    with pytest.raises(ValueError, match=r"val_step9_000\d.png: 319x120 px"):
        views.find(config)


def test_views_without_a_pair_are_left_out_and_named(tmp_path, caplog):
    config = cases.project(tmp_path)
    (tmp_path / "renders" / "v07.png").unlink()
    cases.write_png(tmp_path / "renders" / "v06.png", cases.picture(6, (80, 60)))
    judged = views.find(config)
    assert [pair.name for pair in judged.pairs] == cases.NAMES[:6]
    assert "1 of 8 photos have no render: v07" in caplog.text
    assert "another size than 160x120 are left out: v06" in caplog.text
    assert judged.told["of_other_size"] == ["v06"]


def test_photos_that_lie_on_their_side(tmp_path):
    """EXIF's orientation is applied where only that fits the render."""
    for i, name in enumerate(cases.NAMES):
        upright = cases.picture(i, (120, 160))
        cases.write_png(tmp_path / "renders" / f"{name}.png", upright)
        stored = np.ascontiguousarray(np.rot90(upright))
        path = tmp_path / "photos" / f"{name}.jpg"
        path.parent.mkdir(exist_ok=True)
        exif = Image.Exif()
        exif[0x0112] = 6
        Image.fromarray(stored).save(path, quality=97, exif=exif)
    scene = prepare(tmp_path, cases.config(tmp_path))
    told = json.loads((scene / "poses.json").read_text())
    assert (told["width"], told["height"]) == (120, 160)
    assert told["external_renders"]["cameras"] == "none"
    assert told["external_renders"]["apart_px"]["taken"] < 0.1


def test_both_splits_and_their_check(tmp_path):
    config = cases.project(tmp_path)
    for i, name in enumerate(cases.NAMES):
        split = "test" if i % 4 == 0 else "train"
        (tmp_path / "renders" / split).mkdir(exist_ok=True)
        file = tmp_path / "renders" / f"{name}.png"
        file.rename(tmp_path / "renders" / split / f"{name}.png")
    scene = prepare(tmp_path, config)
    with pytest.raises(ValueError, match="there are renders of train, test"):
        run(scene)
    (scene / "theirs").rmdir()
    out = run(scene, ("train", "test"))
    assert sorted(p.stem for p in (out / "renders" / "test").glob("v*")) == [
        "v00",
        "v04",
    ]


@pytest.mark.parametrize("longest_px", [None, 50, 5000])
def test_the_size_of_the_training_photos_is_taken_from_its_trainer(
    tmp_path, longest_px
):
    """Where renders are larger, they lack detail: that is for their octaves to say."""
    config = cases.project(tmp_path)
    shot = {"img_name": "v00", "position": [0, 0, 0], "rotation": np.eye(3).tolist()}
    shot |= {"width": longest_px, "height": 30, "fx": 40.0, "fy": 40.0}
    if longest_px:
        (tmp_path / "cameras.json").write_text(json.dumps([shot]))
    told = json.loads((prepare(tmp_path, config) / "poses.json").read_text())
    known_px = longest_px if longest_px == 5000 else None
    assert told["external_renders"]["trained_px"] == known_px


def test_depth_by_the_points_of_the_cameras(tmp_path):
    """It is near given depth, and comes out in the unit of the scene alike."""
    config = cases.project(tmp_path)
    rng = np.random.default_rng(0)
    points = rng.uniform([-1, -0.7, -2.2], [2, 0.7, -2.0], (3000, 3))
    lines = [" ".join(map(str, row)) for row in points]
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    head += [*(f"property float {axis}" for axis in "xyz"), "end_header"]
    (tmp_path / "p.ply").write_text("\n".join([*head, *lines]))
    cases.transforms(tmp_path / "transforms.json", ply_file_path="p.ply")
    coarse = prepare(tmp_path, config)
    assert (
        json.loads((coarse / "poses.json").read_text())["external_renders"]["depth"]
        == "points"
    )
    with np.load(run(coarse) / "depth" / "train" / "v03.npz") as data:
        from_points = data["depth"]
    (tmp_path / "depth").mkdir()
    for name in cases.NAMES:
        np.save(tmp_path / "depth" / f"{name}.npy", np.full((120, 160), 2.1))
    other = tmp_path / "other"
    other.mkdir()
    kinds = {"cameras": str(tmp_path / "transforms.json")}
    kinds |= {"depth": str(tmp_path / "depth")}
    given = prepare(other, cases.config(tmp_path, **kinds))
    with np.load(run(given) / "depth" / "train" / "v03.npz") as data:
        np.testing.assert_allclose(data["depth"], from_points, rtol=0.06)


def test_depth_has_the_distortion_that_its_render_has(tmp_path):
    """An edge in the depth lies where the same edge of the render does."""
    cases.project(tmp_path)
    depth = np.where(np.indices((120, 160))[1] < 20, 2.0, 5.0)
    edge = np.where(depth[..., None] < 3, 40, 200).repeat(3, -1).astype(np.uint8)
    (tmp_path / "depth").mkdir()
    for name in cases.NAMES:
        cases.write_png(tmp_path / "renders" / f"{name}.png", edge)
        cases.write_png(tmp_path / "photos" / f"{name}.png", edge)
        np.save(tmp_path / "depth" / f"{name}.npy", depth)
    kinds = {"cameras": str(tmp_path / "transforms.json")}
    kinds |= {"depth": str(tmp_path / "depth")}
    out = run(prepare(tmp_path, cases.config(tmp_path, **kinds)))
    with np.load(out / "depth" / "train" / "v03.npz") as data:
        near = data["depth"] < np.median(data["depth"])
    render = np.asarray(Image.open(out / "renders" / "train" / "v03.png"))[..., 0]
    clear = (render < 90) | (render > 150)
    assert clear.mean() > 0.95
    np.testing.assert_array_equal(near[clear], (render < 120)[clear])


def test_depth_of_some_views_is_warned_of(tmp_path, caplog):
    cases.project(tmp_path)
    (tmp_path / "depth").mkdir()
    np.save(tmp_path / "depth" / "v02.npy", np.ones((120, 160)))
    kinds = {"cameras": str(tmp_path / "transforms.json")}
    kinds |= {"depth": str(tmp_path / "depth")}
    prepare(tmp_path, cases.config(tmp_path, **kinds))
    assert "7 of 8 views have no depth" in caplog.text


def test_photos_of_several_sizes_and_lenses_go_out_at_one(tmp_path):
    """The usual one: of a lens of its own, each would have another."""
    config = cases.project(tmp_path, "kept")
    path = tmp_path / "transforms.json"
    content = json.loads(path.read_text())
    for i, frame in enumerate(content["frames"]):
        frame |= {"k1": -0.18 + 0.01 * i, "fl_x": 150 + i, "fl_y": 150 + i}
    path.write_text(json.dumps(content))
    image = Image.fromarray(cases.picture(2))
    image.resize((240, 180)).save(tmp_path / "photos" / "v02.png")
    large, _ = views.at_full_size(config)
    assert large.names == cases.NAMES
    for photo in large.photos:
        assert photo.read().shape == (large.height, large.width, 3)
    np.testing.assert_allclose(
        np.linalg.inv(large.pixtocams[2])[:2, 2] / [large.width, large.height],
        cases.CAMTOPIX[:2, 2] / cases.SIZE,
        rtol=1e-6,
    )


@pytest.mark.parametrize("k1", [-0.18, 0.1])
def test_what_no_photo_shows_is_masked_in_an_export(tmp_path, k1):
    """With the photo's focal length, a picture of a pincushion lens is larger."""
    config = cases.project(tmp_path)
    lens = np.array([k1, 0, 0, 0, 0])
    cases.transforms(tmp_path / "transforms.json", lens=lens)
    for i, name in enumerate(cases.NAMES):
        image = cases.shown("kept", lens).picture(cases.picture(i))
        cases.write_png(tmp_path / "renders" / f"{name}.png", image)
    assert views.shown_of(views.find(config), None)[1] == "kept"
    large, _ = views.at_full_size(config)
    assert (large.masks is None) == (k1 < 0)
    if large.masks:
        mask = large.masks[0].read()
        assert not mask[0, 0].any()
        assert mask[60, 80].all()


def test_a_guessed_lens_is_that_of_the_photo_as_it_is_shown(tmp_path):
    """Not of the photo upright, where a render shows it as its rows are stored."""
    cases.project(tmp_path)
    path = tmp_path / "photos" / "v00.png"
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.open(path).save(path.with_suffix(".jpg"), exif=exif)
    path.unlink()
    judged = views.find(cases.config(tmp_path))
    for pair in judged.pairs:
        np.testing.assert_array_equal(pair.lens[0][:2, 2], (80, 60))


@pytest.mark.parametrize(
    ("break_it", "says"),
    [
        (
            lambda f: cases.transforms(f / "transforms.json", ["a", "b"]),
            r"no photo .*there are v00\.png",
        ),
        (lambda f: (f / "photos").rename(f / "gone"), "no folder of photos"),
        (lambda f: (f / "transforms.json").write_text("{"), "transforms.json"),
        (lambda f: [p.unlink() for p in (f / "photos").iterdir()], "no photos"),
    ],
)
def test_faults_are_one_line(tmp_path, break_it, says):
    config = cases.project(tmp_path)
    break_it(tmp_path)
    with pytest.raises(ValueError, match=says) as caught:
        views.find(config)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "scene").exists()


def test_a_camera_out_of_all_bounds_is_named_by_its_file(tmp_path):
    config, path = cases.project(tmp_path), tmp_path / "transforms.json"
    content = json.loads(path.read_text())
    content["frames"][3]["transform_matrix"][1][3] = 1e200
    path.write_text(json.dumps(content))
    says = r"transforms\.json: camtoworlds of view 'v03' is not .* below 1e\+18"
    with pytest.raises(ValueError, match=says):
        views.load(config, tmp_path)


def test_photos_are_no_renders_of_themselves(tmp_path):
    cases.project(tmp_path)
    config = cases.config(tmp_path, renders=str(tmp_path / "photos"))
    with pytest.raises(ValueError, match=r"v00\.png: this render is the photo itself"):
        views.find(config)


@pytest.mark.parametrize("where", ["images/", "C:\\\\me\\\\scan\\\\", "", "/home/me/"])
@pytest.mark.parametrize("inner", [".", "images", "frames"])
def test_photos_in_folders_are_found_by_their_paths(tmp_path, caplog, where, inner):
    """Those of other machines, too; what lacks a partner is left out."""
    names = [f"cam{i % 2}/{i // 2}" for i in range(8)]
    cases.photos(tmp_path / "photos" / inner, names)
    cases.photos(tmp_path / "photos" / "renders", names)
    told = cases.transforms(tmp_path / "transforms.json", [*names[1:], "cam1/9"])
    content = told.read_text().replace("images/", where).replace(".png", ".JPG")
    told.write_text(content.replace("cam0/", "cam0\\\\") if "\\" in where else content)
    within = str(tmp_path / "photos" / "renders")
    config = cases.config(tmp_path, cameras=str(told), renders=within)
    judged = views.find(config)
    assert [pair.name for pair in judged.pairs] == sorted(
        name.replace("/", "_") for name in names[1:]
    )
    for pair in judged.pairs:
        folder, number = pair.name.split("_")
        assert pair.photo == tmp_path / "photos" / inner / folder / f"{number}.png"
        assert pair.render.path.parts[-3:] == ("renders", folder, f"{number}.png")
        at = names.index(pair.name.replace("_", "/")) - 1
        assert pair.pose[0, 3] == pytest.approx(0.2 * at)
    assert "no photo of 1 of 8 cameras" in caplog.text
    assert "no pose of cam0_0" in caplog.text


def test_without_cameras_folders_are_part_of_a_view_s_name(tmp_path):
    names = ["cam0/1", "cam1/1", "cam1/2"]
    cases.photos(tmp_path / "photos", names)
    # A link is no second photo.
    (tmp_path / "photos" / "cam1" / "z.png").symlink_to("2.png")
    found = views.taken(tmp_path / "photos").shots
    assert [shot.name for shot in found] == ["cam0_1", "cam1_1", "2"]


def test_two_photos_of_one_view_name_are_refused_unless_cameras_tell(tmp_path):
    cases.photos(tmp_path)
    (tmp_path / "v00.jpg").write_bytes((tmp_path / "v00.png").read_bytes())
    with pytest.raises(ValueError, match="have the same view name, v00"):
        views.taken(tmp_path)
    told = cases.transforms(tmp_path / "transforms.json")
    assert views.taken(tmp_path, told).shots[0].photo == tmp_path / "v00.png"
