"""Exports at the photos' own size: cameras, pixels, sizes."""

import json

import numpy as np
import pytest

from alignerf import export, poses
from alignerf.io import images
from alignerf.readers import transforms
from alignerf.scenes import cameras, prepare, prepared
from tests import export_cases as cases


def test_photos_and_cameras_have_the_size_that_they_came_in(made, views, tmp_path):
    out = cases.exported(made, tmp_path)
    assert (views.width, views.height) == (cases.WIDTH, cases.HEIGHT)
    _, found = cases.check_cameras(out, views)
    for i, name in enumerate(views.names):
        photo = images.read(
            out / "images" / f"{name}.png", size=(cases.WIDTH, cases.HEIGHT)
        )
        np.testing.assert_array_equal(photo, views.photos[i].read())
        np.testing.assert_array_equal(photo, found.photos[i].read())
    assert not (out / "masks").exists()
    # The scene's points stay with the scene's cameras.
    text = (out / "README.txt").read_text()
    assert f"8 photos of {cases.WIDTH}x{cases.HEIGHT} pixels" in text
    assert f"trained on {cases.WIDTH // 2}x{cases.HEIGHT // 2} pixels" in text
    assert "Cameras are as given." in text


@pytest.mark.parametrize("width", [100, 96])
def test_a_width_scales_the_intrinsics_by_the_true_ratio(made, views, tmp_path, width):
    out = cases.exported(made, tmp_path, "--width", width)
    wanted = prepare.downscale(views, cases.WIDTH / width)
    assert wanted.width == width
    cases.check_cameras(out, wanted)
    photo = images.read(out / "images" / f"{views.names[0]}.png")
    shrunk = prepare.shrink(views.photos[0].read(), width, wanted.height)
    np.testing.assert_array_equal(photo, shrunk)


def test_nothing_is_enlarged(made, views, tmp_path, caplog):
    out = cases.exported(made, tmp_path, "--width", 5000)
    cases.check_cameras(out, views)
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
    whole = cases.OF_COURTYARD | config
    if config:
        whole = {"source": "photos"} | config
    code = cases.run(made, tmp_path / "out", *more, config=whole)
    (line,) = [li for li in capsys.readouterr().err.splitlines() if "error" in li]
    assert (code, reason in line) == (1, True), line
    assert not list(tmp_path.iterdir())


def test_the_folder_of_results_has_the_keys_too(made, views, tmp_path):
    """By hand, without --config."""
    path = made / "config.yaml"
    path.write_text(json.dumps({"scenes": {"yard": cases.OF_COURTYARD}}))
    try:
        export.main(["--scene", str(made), "--out", str(tmp_path / "out")])
    finally:
        path.unlink()
    cases.check_cameras(tmp_path / "out", views)


def test_a_scene_made_of_the_export_has_the_same_cameras(made, views, tmp_path):
    out = cases.exported(made, tmp_path)
    config = {"source": "transforms", "path": str(out), "downscale": 2}
    poses.main(config | {"min_train_views": 2}, tmp_path / "again")
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


@pytest.mark.whole
def test_of_photos_points_land_on_their_pixels(taken, tmp_path):
    """COLMAP's cameras at the photos' size; masks under the names of both programs."""
    config, scene, wanted = taken
    out = cases.exported(scene, tmp_path, config=config)
    model, found = cases.check_cameras(out, wanted)
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
        mask = cases.read_mask(out / "masks" / f"{name}.png.png")
        np.testing.assert_array_equal(
            mask, wanted.masks[i].read()[..., 0] >= prepare.WHITE
        )
        np.testing.assert_array_equal(mask, found.masks[i].read()[..., 0] > 0)
        assert not mask.all()
    text = (out / "README.txt").read_text()
    assert "--ImageReader.mask_path masks" in text
    assert "COLMAP's: its unit of length is arbitrary" in text


def test_crops_go_out_as_they_are(made, tmp_path):
    config = cases.OF_COURTYARD | {"downscale": 1, "crop": {"of": "whole", "px": 64}}
    poses.main(config, tmp_path / "crops", made, made / "cameras.npz")
    out = cases.exported(tmp_path / "crops", tmp_path, config=config)
    loaded = prepared.load(tmp_path / "crops")
    found, _ = transforms.read(out)
    assert found.width == found.height == loaded.width
    for i, name in enumerate(loaded.names):
        own = images.read(tmp_path / "crops/images" / f"{name}.png")
        np.testing.assert_array_equal(found.photos[i].read(), own)
