"""Exports at the photos' own size: cameras, pixels, warps, masks, points, and words."""

import json

import numpy as np
import pycolmap
import pytest
from PIL import Image

from alignerf import export, poses
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.exports import formats, held_out, readme, warps
from alignerf.files import faults, images
from alignerf.scenes import cameras, colmap, prepare, prepared, transforms
from alignerf.scenes.capture import full_size
from alignerf.scenes.courtyard import scene as courtyard
from flow.warping import small, warp

WIDTH, HEIGHT = 192, 144
OF_COURTYARD = {
    "source": "courtyard",
    "poses": "truth",
    "downscale": 2,
    "test_every": 3,
    "least_train_views": 2,
    "courtyard": {"views": 8, "width": WIDTH, "height": HEIGHT},
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A prepared courtyard at half the size of its photos."""
    folder = tmp_path_factory.mktemp("made") / "yard"
    poses.main(OF_COURTYARD, folder)
    return folder


@pytest.fixture(scope="module")
def views(made, tmp_path_factory):
    """Its views at full size, whose photos can be read."""
    config = of_scenes.checked(OF_COURTYARD)
    return full_size.read(config, made, tmp_path_factory.mktemp("work"))


def run(made, out, *more, config=OF_COURTYARD):
    words = ["--scene", made, "--config", json.dumps(config), "--out", out, *more]
    return faults.exit_code(export.main, [str(word) for word in words])


def exported(made, folder, *more, **options):
    assert run(made, folder / "out", *more, **options) == 0
    return folder / "out"


def check_cameras(out, wanted, atol=1e-6):
    """That pycolmap and our own reader have the same cameras as `wanted`."""
    found, left_out = transforms.read(out)
    assert left_out == []
    assert found.names == wanted.names
    assert (found.width, found.height) == (wanted.width, wanted.height)
    assert found.split.tolist() == wanted.split.tolist()
    model = pycolmap.Reconstruction(out / "sparse" / "0")
    of_colmap = colmap.convert(model, wanted.names)
    assert of_colmap.names == wanted.names
    sizes = {(one.width, one.height) for one in model.cameras.values()}
    assert sizes == {(wanted.width, wanted.height)}
    camtopix = np.linalg.inv(wanted.pixtocams)
    for mine in (np.linalg.inv(found.pixtocams), of_colmap.camtopix):
        np.testing.assert_allclose(mine, camtopix, rtol=0, atol=atol)
    for mine in (found.camtoworlds, of_colmap.camtoworlds):
        np.testing.assert_allclose(mine, wanted.camtoworlds, rtol=0, atol=atol)
    return model, found


def check_points(model, wanted, at_most_px):
    """That points land, by COLMAP's camera and by ours, where their photos see them."""
    place = {f"{name}.png": i for i, name in enumerate(wanted.names)}
    away_px, apart_px = [], []
    for image in model.images.values():
        i = place[image.name]
        for seen in (p for p in image.points2D if p.has_point3D()):
            point = model.points3D[seen.point3D_id].xyz
            camera = wanted.pixtocams[i], wanted.camtoworlds[i]
            ours = cameras.project(point[None], *camera)[0][0]
            apart_px.append(np.linalg.norm(ours - image.project_point(point)))
            away_px.append(np.linalg.norm(ours - seen.xy))
    assert len(away_px) > 50
    assert max(apart_px) < 1e-6
    assert np.median(away_px) < at_most_px


def test_photos_and_cameras_have_the_size_that_they_came_in(made, views, tmp_path):
    out = exported(made, tmp_path)
    assert (views.width, views.height) == (WIDTH, HEIGHT)
    _, found = check_cameras(out, views)
    for i, name in enumerate(views.names):
        photo = images.read(out / "images" / f"{name}.png", size=(WIDTH, HEIGHT))
        np.testing.assert_array_equal(photo, views.photos[i].read())
        np.testing.assert_array_equal(photo, found.photos[i].read())
    assert not (out / "masks").exists()
    # The scene's points stay with the scene's cameras.
    text = (out / "README.txt").read_text()
    assert f"8 photos of {WIDTH}x{HEIGHT} pixels" in text
    assert f"trained on {WIDTH // 2}x{HEIGHT // 2} pixels" in text
    assert "Cameras are as given." in text


@pytest.mark.parametrize("width", [100, 96])
def test_a_width_scales_the_intrinsics_by_the_true_ratio(made, views, tmp_path, width):
    out = exported(made, tmp_path, "--width", width)
    wanted = prepare.downscale(views, WIDTH / width)
    assert wanted.width == width
    check_cameras(out, wanted)
    photo = images.read(out / "images" / f"{views.names[0]}.png")
    shrunk = prepare.shrink(views.photos[0].read(), width, wanted.height)
    np.testing.assert_array_equal(photo, shrunk)


def test_nothing_is_enlarged(made, views, tmp_path, caplog):
    out = exported(made, tmp_path, "--width", 5000)
    check_cameras(out, views)
    assert "photos of 192 px stay as they are" in caplog.text


@pytest.mark.parametrize(
    ("more", "config", "reason"),
    [
        (["--width", "33"], {}, "export_width_px: 33 leaves less than 32 px"),
        ([], {"source": "photos", "path": "gone"}, "gone: the photos of"),
        ([], {"source": "photos"}, "config: path"),
        (["--config", "{"], {}, "--config is not JSON"),
    ],
)
def test_bad_input_is_one_line(made, tmp_path, capsys, more, config, reason):
    whole = OF_COURTYARD | config
    if config:
        whole = {"source": "photos"} | config
    code = run(made, tmp_path / "out", *more, config=whole)
    (line,) = [li for li in capsys.readouterr().err.splitlines() if "error" in li]
    assert (code, reason in line) == (1, True), line
    assert not list(tmp_path.iterdir())


def test_the_folder_of_results_has_the_keys_too(made, views, tmp_path):
    """By hand, without --config."""
    path = made / "config.yaml"
    path.write_text(json.dumps({"scenes": {"yard": OF_COURTYARD}}))
    try:
        export.main(["--scene", str(made), "--out", str(tmp_path / "out")])
    finally:
        path.unlink()
    check_cameras(tmp_path / "out", views)


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    """A folder of twelve neighbouring photos with masks."""
    folder = tmp_path_factory.mktemp("photos")
    world = courtyard.build_world(seed=0)
    found = courtyard.make_cameras(views=60, width=240, height=180, seed=0)
    mask = np.full((180, 240, 3), 255, np.uint8)
    mask[:, :20] = 0
    (folder / "masks").mkdir()
    for i in range(12):
        camera = [of[i] for of in found]
        image = courtyard.render(world, *camera, 240, 180, courtyard.at_rest()).image
        images.write(folder / f"view {i}.png", image)
        images.write(folder / "masks" / f"view {i}.png", mask)
    return folder


@pytest.fixture(scope="module")
def taken(photos, tmp_path_factory):
    """(config, the scene prepared of them, its views at full size)."""
    config = {"source": "photos", "path": str(photos), "downscale": 2}
    config["masks"] = str(photos / "masks")
    folder = tmp_path_factory.mktemp("taken")
    poses.main(config, folder / "scene")
    (folder / "work").mkdir()
    whole = of_scenes.checked(config)
    return (
        config,
        folder / "scene",
        full_size.read(whole, folder / "scene", folder / "work"),
    )


@pytest.fixture
def moved(made, tmp_path, rng):
    """Cameras that have moved, those of training views alone."""
    arrays = prepared.read_cameras(made / "cameras.npz")
    train = arrays["split"] == "train"
    shift = 0.002 * rng.normal(size=(len(train), 3))
    arrays["camtoworlds"][train, :, 3] += shift[train]
    np.savez(tmp_path / "moved.npz", **arrays)
    return tmp_path / "moved.npz"


def test_cameras_that_moved_have_points_of_their_own(taken, tmp_path):
    config, scene, views = taken
    arrays = prepared.read_cameras(scene / "cameras.npz")
    arrays["camtoworlds"][:, :, 3] *= 1.001
    arrays["camtoworlds"][arrays["split"] == "test", :, 3] += 0.01
    np.savez(tmp_path / "moved.npz", **arrays)
    more = ("--cameras", tmp_path / "moved.npz")
    out = exported(scene, tmp_path, *more, config=config)
    wanted = views._replace(camtoworlds=arrays["camtoworlds"])
    model, _ = check_cameras(out, wanted)
    check_points(model, wanted, 1.0)
    # Held-out cameras have not moved, so they see none.
    seen = {i.name.removesuffix(".png"): i.num_points3D for i in model.images.values()}
    train = arrays["names"][arrays["split"] == "train"].tolist()
    assert {name for name, count in seen.items() if count} <= set(train)
    colours = np.array([p.color for p in model.points3D.values()])
    assert colours.any(axis=1).mean() > 0.9
    ply = pycolmap.Reconstruction()
    ply.import_PLY(str(out / formats.POINTS))
    assert ply.num_points3D() == model.num_points3D()
    content = json.loads((out / "transforms.json").read_text())
    assert content["ply_file_path"] == formats.POINTS
    text = (out / "README.txt").read_text()
    assert "learn from are corrected by this run" in text
    assert "held-out photos are as given: no training has moved them" in text
    assert (
        f"triangulated anew, by the cameras here and features of {len(train)}" in text
    )


def test_held_out_cameras_are_fitted_and_marked(made, views, tmp_path):
    """A flow that a camera's own error has made moves it back."""
    true = prepared.read_cameras(made / "cameras.npz")
    test = np.flatnonzero(true["split"] == "test")
    off = {key: array.copy() for key, array in true.items()}
    off["camtoworlds"][:, :, 3] += [0.01, 0.0, 0.005]
    np.savez(tmp_path / "off.npz", **off)
    loaded = prepared.load(made, tmp_path / "off.npz")
    right = prepared.load(made)
    for name in ("flow", "depth"):
        (tmp_path / name).mkdir()
    y, x = np.indices((loaded.height, loaded.width)) + 0.5
    for view in test:
        name = f"{loaded.names[view]}.npz"
        depth = np.full(x.shape, 2.0, np.float32) + (x > 40) + 0.3 * (y > 30)
        pixels = np.stack([x, y, np.ones_like(x)], axis=-1)
        rays = pixels @ loaded.pixtocams[view].T * [1, -1, -1]
        pose = loaded.camtoworlds[view]
        points = (rays * depth[..., None]) @ pose[:, :3].T + pose[:, 3]
        camera = right.pixtocams[view], right.camtoworlds[view]
        landed, _ = cameras.project(points.reshape(-1, 3), *camera)
        flow_px = (landed.reshape(*x.shape, 2) - pixels[..., :2]).astype(np.float32)
        np.savez(tmp_path / "flow" / name, flow_px=flow_px, valid=x > 0)
        np.savez(tmp_path / "depth" / name, depth=depth.astype(np.float32))
    more = ("--fit-held-out", tmp_path / "flow", tmp_path / "depth")
    out = exported(made, tmp_path, "--cameras", tmp_path / "off.npz", *more)
    found, _ = transforms.read(out)
    for view in range(len(loaded.names)):
        wanted = (true if view in test else off)["camtoworlds"][view]
        np.testing.assert_allclose(found.camtoworlds[view], wanted, atol=2e-3)
    content = json.loads((out / "transforms.json").read_text())
    marked = [i for i, frame in enumerate(content["frames"]) if "camera" in frame]
    assert marked == test.tolist()
    assert content["frames"][marked[0]]["camera"] == "fitted to its own photo"
    assert f"{len(test)} held-out photos" in (out / "README.txt").read_text()


def test_a_held_out_camera_without_a_flow_stays(made, tmp_path, caplog):
    loaded = prepared.load(made)
    size = loaded.height, loaded.width
    for view in loaded.views("test"):
        name = f"{loaded.names[view]}.npz"
        flow_px = np.zeros((*size, 2), np.float32)
        np.savez(tmp_path / name, flow_px=flow_px, valid=np.zeros(size, bool))
    (tmp_path / "depth").mkdir()
    for view in loaded.views("test"):
        depth = np.ones(size, np.float32)
        np.savez(tmp_path / "depth" / f"{loaded.names[view]}.npz", depth=depth)
    own = made / "cameras.npz"
    out = tmp_path / "cameras.npz"
    assert held_out.fit(loaded, own, tmp_path, tmp_path / "depth", out) == []
    before, after = map(prepared.read_cameras, (own, out))
    np.testing.assert_array_equal(before["camtoworlds"], after["camtoworlds"])
    assert "stays: only 0 pixels have a flow" in caplog.text


@pytest.fixture
def warped(made, tmp_path, rng):
    """Smooth flows of the training views, by which their small photos are warped."""
    loaded = prepared.load(made)
    for name in ("warped", "valid", "offsets"):
        (tmp_path / name).mkdir()
    h, w = loaded.height, loaded.width
    for view in loaded.views("train"):
        name = loaded.names[view]
        offsets_px = rng.normal(size=(h // 4, w // 4, 2)).astype(np.float32)
        flow_px = small.enlarge(offsets_px, 4, (h, w))
        valid = warp.in_frame(flow_px) & (rng.uniform(size=(h, w)) < 0.98)
        photo = images.read(made / "images" / f"{name}.png")
        images.write(tmp_path / "warped" / f"{name}.png", warp.warp(photo, flow_px))
        np.savez(tmp_path / "valid" / f"{name}.npz", flow_px=flow_px, valid=valid)
        np.savez(
            tmp_path / "offsets" / f"{name}.npz",
            valid=valid,
            offsets_px=offsets_px,
            shrink=4,
        )
    return tmp_path


def by_hand(photo, flow_px, valid):
    """A photo of twice the size warped by a flow, pixel by pixel of the flow."""
    large_px = small.enlarge(flow_px, 2, photo.shape[:2])
    inside = small.enlarge_mask(valid, 2, photo.shape[:2]) & warp.in_frame(large_px)
    return warp.warp(photo, large_px), inside


@pytest.mark.parametrize("valid", ["valid", "offsets"])
def test_photos_are_warped_at_full_size(made, views, warped, valid):
    """By a round's flow, and by the offsets of a training that warped on its way."""
    more = ("--warped", warped / "warped", "--valid", warped / valid)
    out = exported(made, warped, *more)
    check_cameras(out, views)
    for i, name in enumerate(views.names):
        image = images.read(out / "images" / f"{name}.png")
        photo, inside = views.photos[i].read(), np.ones((HEIGHT, WIDTH), bool)
        if views.split[i] == "train":
            with np.load(warped / "valid" / f"{name}.npz") as found:
                photo, inside = by_hand(photo, found["flow_px"], found["valid"])
        # Positions are rounded to 1/32 px.
        assert np.abs(image.astype(int) - photo).mean() < 0.02
        mask = transforms.read(out)[0].masks[i].read()
        assert (mask.all(axis=-1) == inside).mean() > 0.999
        assert (out / formats.MASK.format(view=name)).is_file()
    assert "masks/ says where" in (out / "README.txt").read_text()


def test_warps_that_are_not_on_disk_leave_the_size_of_training(made, warped, caplog):
    for path in (warped / "valid").iterdir():
        with np.load(path) as found:
            np.savez(path, valid=found["valid"])
    more = ("--warped", warped / "warped", "--valid", warped / "valid")
    out = exported(made, warped, *more)
    for path in (warped / "warped").iterdir():
        np.testing.assert_array_equal(
            images.read(path), images.read(out / "images" / path.name)
        )
    assert "does not say how photos were warped" in caplog.text
    text = (out / "README.txt").read_text()
    assert "how they were warped is not on disk" in text


def test_a_flow_is_enlarged_by_each_axis_s_own_ratio(rng):
    flow_px = np.broadcast_to(np.float32([2, 3]), (20, 30, 2))
    large_px = warps.enlarge(flow_px, (50, 61))
    assert large_px.shape == (50, 61, 2)
    np.testing.assert_allclose(large_px[..., 0], 2 * 61 / 30, rtol=1e-6)
    np.testing.assert_allclose(large_px[..., 1], 3 * 50 / 20, rtol=1e-6)
    # Of twice the size it is what alignments do.
    flow_px = rng.normal(size=(20, 30, 2)).astype(np.float32)
    twice = warps.enlarge(flow_px, (40, 60)), small.enlarge(flow_px, 2, (40, 60))
    np.testing.assert_allclose(*twice, atol=1e-5)
    mask = rng.uniform(size=(20, 30)) < 0.7
    twice = warps.enlarge_mask(mask, (40, 60)), small.enlarge_mask(mask, 2, (40, 60))
    np.testing.assert_array_equal(*twice)


def test_a_scene_made_of_the_export_has_the_same_cameras(made, views, tmp_path):
    out = exported(made, tmp_path)
    config = {"source": "transforms", "path": str(out), "downscale": 2}
    poses.main(config | {"least_train_views": 2}, tmp_path / "again")
    first, second = (
        prepared.read_cameras(folder / "cameras.npz")
        for folder in (made, tmp_path / "again")
    )
    for key in ("pixtocams", "camtoworlds"):
        np.testing.assert_allclose(first[key], second[key], atol=1e-9)
    for key in ("names", "split", "width", "height"):
        np.testing.assert_array_equal(first[key], second[key])
    for name in views.names:
        both = [
            images.read(f / "images" / f"{name}.png")
            for f in (made, tmp_path / "again")
        ]
        np.testing.assert_array_equal(*both)


def test_of_photos_points_land_on_their_pixels(taken, tmp_path):
    """COLMAP's cameras at the photos' size; masks under the names of both programs."""
    config, scene, wanted = taken
    out = exported(scene, tmp_path, config=config)
    model, found = check_cameras(out, wanted)
    assert wanted.width > 200
    assert model.num_points3D() == len(wanted.points[0])
    place = {f"{name}.png": i for i, name in enumerate(wanted.names)}
    some = list(model.points3D.values())[:50]
    for image in model.images.values():
        i = place[image.name]
        for point in some:
            camera = wanted.pixtocams[i], wanted.camtoworlds[i]
            ours, depth = cameras.project(point.xyz[None], *camera)
            if depth[0] > 0:
                np.testing.assert_allclose(
                    image.project_point(point.xyz), ours[0], atol=1e-6
                )
    for i, name in enumerate(wanted.names):
        mask = read_mask(out / "masks" / f"{name}.png.png")
        np.testing.assert_array_equal(
            mask, wanted.masks[i].read()[..., 0] >= prepare.WHITE
        )
        np.testing.assert_array_equal(mask, found.masks[i].read()[..., 0] > 0)
        assert not mask.all()
    text = (out / "README.txt").read_text()
    assert "--ImageReader.mask_path masks" in text
    assert "COLMAP's: its unit of length is arbitrary" in text


def read_mask(path):
    with Image.open(path) as image:
        assert image.mode == "L"
        return np.asarray(image) > 0


def test_the_readme_has_commands_files_and_what_is_held_out(made, views, tmp_path):
    out = exported(made, tmp_path)
    text = (out / "README.txt").read_text()
    for command in (
        "ns-train splatfacto --data .",
        "ns-train nerfacto --data .",
        "python examples/simple_trainer.py default --data_dir",
        "--data_factor 1",
        "python train.py -s PATH_OF_THIS_FOLDER --eval",
        "colmap gui --import_path sparse/0 --image_path images",
        "colmap model_analyzer --path sparse/0",
    ):
        assert command in text
    test = [n for n, s in zip(views.names, views.split, strict=True) if s == "test"]
    assert f"Held out: {', '.join(test)}" in text
    # Every third of eight; the programs' own way is every eighth.
    assert "NOT those that are held out" in text
    listed = (out / "sparse/0/test.txt").read_text().splitlines()
    assert listed == [f"{name}.png" for name in test]
    assert max(map(len, text.splitlines())) <= 110
    for path in set(out.iterdir()) - {out / "README.txt"}:
        assert path.name in text


def test_the_readme_says_why_cameras_are_as_given(made, moved, tmp_path):
    verdict = tmp_path / "verdict.json"
    verdict.write_text(json.dumps({"gains": [{"method": "aligned", "pays": False}]}))
    more = ("--cameras", moved, "--if-pays", verdict, "aligned")
    out = exported(made, tmp_path, *more)
    text = (out / "README.txt").read_text()
    assert "as given, not corrected: aligned did not show in this run" in text
    assert "So are those of held-out photos." in text


def test_windows_go_out_as_they_are(taken, tmp_path):
    config = taken[0] | {"downscale": 1, "zoom": {"px": 64}}
    poses.main(config, tmp_path / "windows")
    out = exported(tmp_path / "windows", tmp_path, config=config)
    loaded = prepared.load(tmp_path / "windows")
    found, _ = transforms.read(out)
    assert (found.width, found.height) == (64, 64)
    for i, name in enumerate(loaded.names):
        own = images.read(tmp_path / "windows/images" / f"{name}.png")
        np.testing.assert_array_equal(found.photos[i].read(), own)


def test_the_readme_knows_what_other_programs_take(views):
    """Their order is that of the files, and a principal point may be off the middle."""
    names = ["a", "a-1", *"bcdefgh"]
    assert "those that are\nheld out" in readme.of_their_split(names, ["a-1", "h"])
    assert "NOT" in readme.of_their_split(names, ["a", "h"])
    arrays = export.arrays_of(views)
    assert readme.of_middle(arrays) == ""
    arrays["pixtocams"] = arrays["pixtocams"].copy()
    lens = np.linalg.inv(arrays["pixtocams"][0])
    lens[0, 2] += 7.2
    arrays["pixtocams"][0] = np.linalg.inv(lens)
    assert "up to\n7.2 px" in readme.of_middle(arrays)
