"""The entry point as a user meets it: what it writes."""

import json

import cv2
import numpy as np
import pytest

from alignerf import poses
from alignerf.io import images, owned
from alignerf.scenes import cameras, prepared
from alignerf.verdict import evidence

COURTYARD = {
    "source": "courtyard",
    "poses": "truth",
    "downscale": 2,
    "test_every": 3,
    "min_train_views": 2,
    "courtyard": {"views": 4, "width": 96, "height": 72, "motion_m": 0.03},
}


def load(path):
    with np.load(path, allow_pickle=False) as stored:
        return dict(stored)


@pytest.fixture(scope="module")
def courtyard(tmp_path_factory):
    out = tmp_path_factory.mktemp("results") / "courtyard"
    poses.main(COURTYARD, out)
    return out


def test_products_of_the_courtyard(courtyard):
    found = {path.name for path in courtyard.iterdir()}
    assert found == {*poses.PRODUCTS} - {"colmap"}
    stored = load(courtyard / "cameras.npz")
    assert stored["pixtocams"].shape == (4, 3, 3)
    assert stored["camtoworlds"].shape == (4, 3, 4)
    assert stored["pixtocams"].dtype == stored["camtoworlds"].dtype == np.float64
    assert (stored["width"], stored["height"]) == (48, 36)
    assert list(stored["split"]) == ["test", "train", "train", "test"]
    assert list(stored["names"]) == sorted(stored["names"])
    for name in stored["names"]:
        image = images.read(courtyard / "images" / f"{name}.png")
        oracle = images.read(courtyard / "images" / "truth" / "oracle" / f"{name}.png")
        assert image.shape == oracle.shape == (36, 48, 3)
        flow = load(courtyard / "images" / "truth" / "flow" / f"{name}.npz")
        assert flow["flow_px"].shape == (36, 48, 2)
        assert flow["flow_px"].dtype == np.float32
        assert flow["valid"].dtype == bool
        assert flow["valid"].mean() > 0.8
    report = json.loads((courtyard / "poses.json").read_text())
    assert (report["registered"], report["total"]) == (4, 4)
    assert 0 < report["true_misalignment_px"] < 2


def test_depth_explains_the_true_flow_of_a_still_scene(tmp_path):
    still = COURTYARD["courtyard"] | {"motion": "none"}
    poses.main(COURTYARD | {"courtyard": still, "perturb_px": 1.0}, tmp_path)
    given, true = (
        load(tmp_path / "cameras.npz"),
        load(tmp_path / "images/truth/cameras.npz"),
    )
    x, y = np.meshgrid(np.arange(48.0), np.arange(36.0))
    for i, name in enumerate(given["names"]):
        depth_m = load(tmp_path / "images" / "truth" / "depth" / f"{name}.npz")[
            "depth_m"
        ]
        flow = load(tmp_path / "images" / "truth" / "flow" / f"{name}.npz")
        rays = cameras.pixels_to_rays(
            x, y, given["pixtocams"][i], given["camtoworlds"][i]
        )
        points = rays.origins + depth_m[..., None] * rays.directions
        pixel, _ = cameras.project(points, true["pixtocams"][i], true["camtoworlds"][i])
        wanted = pixel - np.stack([x, y], axis=-1) - 0.5
        error = np.abs(flow["flow_px"] - wanted)[flow["valid"]]
        assert error.max() < 1e-2


@pytest.mark.parametrize("by", ["rotation", "translation"])
def test_perturbed_poses_and_the_true_flow_that_undoes_them(by, tmp_path):
    """Warping the photo by the true flow brings it onto the oracle."""
    still = COURTYARD["courtyard"] | {"motion": "none"}
    changes = {"courtyard": still, "perturb_px": 2.0, "perturb_by": by}
    poses.main(COURTYARD | changes, tmp_path)
    assert json.loads((tmp_path / "poses.json").read_text())["perturb_by"] == by
    given, true = (
        load(tmp_path / "cameras.npz"),
        load(tmp_path / "images/truth/cameras.npz"),
    )
    np.testing.assert_array_equal(given["pixtocams"], true["pixtocams"])
    np.testing.assert_array_equal(given["names"], true["names"])
    off = np.abs(given["camtoworlds"] - true["camtoworlds"]).max(axis=(0, 1))
    assert (off[:3].max() > 1e-3) == (by == "rotation")
    assert (off[3] > 1e-3) == (by == "translation")
    before, after = [], []
    x, y = np.meshgrid(np.arange(48, dtype=np.float32), np.arange(36, dtype=np.float32))
    for name in given["names"]:
        photo = images.read(tmp_path / "images" / f"{name}.png")
        oracle = images.read(tmp_path / "images" / "truth" / "oracle" / f"{name}.png")
        flow = load(tmp_path / "images" / "truth" / "flow" / f"{name}.npz")
        warped = cv2.remap(
            photo,
            x + flow["flow_px"][..., 0],
            y + flow["flow_px"][..., 1],
            cv2.INTER_CUBIC,
        )
        for errors, image in ((before, photo), (after, warped)):
            errors.append(np.abs(image - oracle.astype(float))[flow["valid"]].mean())
    assert np.mean(after) < 0.6 * np.mean(before)


def test_runs_are_identical_and_replace_what_was_there(courtyard, tmp_path):
    (tmp_path / "images").mkdir()
    (tmp_path / "images" / "old.png").write_bytes(b"")
    with pytest.raises(ValueError, match=r"images: has files, and none is .why-blurry"):
        poses.main(COURTYARD, tmp_path)
    owned.seal(tmp_path / "images")
    poses.main(COURTYARD, tmp_path)
    assert not (tmp_path / "images" / "old.png").exists()
    for path in courtyard.rglob("*.*"):
        if path.suffix == ".png":
            other = tmp_path / path.relative_to(courtyard)
            assert other.read_bytes() == path.read_bytes()
    first, second = load(courtyard / "cameras.npz"), load(tmp_path / "cameras.npz")
    np.testing.assert_array_equal(first["camtoworlds"], second["camtoworlds"])


@pytest.mark.whole
def test_courtyard_through_colmap(tmp_path):
    """A small courtyard, photographed densely enough for COLMAP."""
    config = {
        "source": "courtyard",
        "downscale": 2,
        # A sharper lens than the default, whose blur is for photos of 400 px.
        "courtyard": {
            "views": 24,
            "width": 240,
            "height": 180,
            "motion": "none",
            "lens_sigma_px": 0.7,
        },
    }
    poses.main(config, tmp_path, adjust=True)
    report = json.loads((tmp_path / "poses.json").read_text())
    assert report["poses"] == "colmap"
    # The check of its cameras stands beside the lenses that COLMAP has found.
    assert [lens["views"] for lens in report["cameras"]] == [report["registered"]]
    assert report["camera_check"]["epipolar_px"] < 0.5
    assert evidence.of_matches(report).before_px < 0.5
    assert load(tmp_path / "images/adjusted/train.npz")["names"].size
    assert report["registered"] >= 12
    assert report["registered"] + len(report["left_out"]) == report["total"] == 24
    found, true = (
        load(tmp_path / name) for name in ("cameras.npz", "images/truth/cameras.npz")
    )
    off = np.abs(found["camtoworlds"] - true["camtoworlds"]).mean(axis=(0, 1))
    assert (off < [0.03, 0.03, 0.03, 0.05]).all()
    np.testing.assert_allclose(found["pixtocams"], true["pixtocams"], atol=0.03)
    assert report["true_misalignment_px"] < 2
    assert len(list((tmp_path / "images").glob("*.png"))) == report["registered"]
    # What it triangulated lies where the cameras look: on the courtyard's surfaces.
    stored, seen = load(tmp_path / "cameras.npz"), load(tmp_path / prepared.POINTS)
    assert len(seen["points"]) == len(seen["colours"]) == report["points"]
    first = str(stored["names"][0])
    depth_m = load(tmp_path / "images" / "truth" / "depth" / f"{first}.npz")["depth_m"]
    camera = stored["pixtocams"][0], stored["camtoworlds"][0]
    pixels, front = cameras.project(seen["points"], *camera)
    x, y = pixels.astype(int).T
    inside = (x >= 0) & (x < 120) & (y >= 0) & (y < 90) & (front > 0)
    assert inside.mean() > 0.2
    there = depth_m[y[inside], x[inside]]
    # Others are hidden in this view: none of them is before what it shows.
    near = np.abs(front[inside] - there) < 0.05 * there
    assert near.mean() > 0.3
    assert (front[inside] < 0.9 * there).mean() < 0.1


def test_crops_of_a_scene_have_its_photos_cameras_split(tmp_path):
    """Without COLMAP, at the photos' own size, several of each photo."""
    courtyard = COURTYARD["courtyard"] | {"width": 192, "height": 144, "views": 6}
    whole = COURTYARD | {"courtyard": courtyard}
    poses.main(whole, tmp_path / "whole")
    points = np.random.default_rng(0).normal(scale=0.7, size=(200, 3))
    path = tmp_path / "whole" / prepared.POINTS
    np.savez(path, points=points, colours=np.zeros((200, 3), np.uint8))
    given = tmp_path / "whole" / "cameras.npz"
    moved = load(given)
    moved["camtoworlds"][:, 0, 3] += 1e-3
    np.savez(tmp_path / "moved.npz", **moved)
    crop = {"of": "whole", "px": 64, "count": 2}
    config = whole | {"downscale": 1, "perturb_px": 0.0, "crop": crop}
    poses.main(config, tmp_path / "given", tmp_path / "whole", given)
    # Other cameras, at the same places.
    out, places = tmp_path / "crops", tmp_path / "given"
    poses.main(config, out, tmp_path / "whole", tmp_path / "moved.npz", places)
    first = json.loads((places / "poses.json").read_text())["crop"]
    assert json.loads((out / "poses.json").read_text())["crop"] == first
    stored = load(out / "cameras.npz")
    told = json.loads((out / "poses.json").read_text())
    assert told["crop"]["of"] == "whole"
    assert told["photo_size"] == [192, 144]
    assert len(told["crop"]["points"]) == 2
    side = told["crop"]["px"]
    assert stored["width"] == stored["height"] == side <= 64
    assert not (out / "images" / "truth").exists()
    views = zip(stored["names"], stored["split"], stored["camtoworlds"], strict=True)
    of_whole = dict(zip(moved["names"], moved["split"], strict=True))
    for name, split, pose in views:
        photo, _, place = str(name).rpartition("_w")
        assert place in "01"
        assert of_whole[photo] == split
        own = moved["camtoworlds"][list(moved["names"]).index(photo)]
        np.testing.assert_array_equal(pose, own)
        assert images.read(out / "images" / f"{name}.png").shape == (side, side, 3)


def test_crops_of_views_that_share_no_points(tmp_path, monkeypatch):
    """They lie where all cameras look; where those look apart, one line says so."""
    changes = {"perturb_px": 0.05, "perturb_by": "translation"}
    poses.main(COURTYARD | changes, tmp_path / "whole")
    crop = {"of": "whole", "px": 64, "count": 2}
    config = COURTYARD | {"downscale": 1, "crop": crop}
    given = (tmp_path / "whole", tmp_path / "whole" / "cameras.npz")
    poses.main(config, tmp_path / "out", *given)
    told = json.loads((tmp_path / "out" / "poses.json").read_text())
    assert len(told["crop"]["points"]) == 1
    # The error is that of the photos' cameras, which crops have.
    assert (told["perturb_px"], told["perturb_by"]) == (
        pytest.approx(0.1),
        "translation",
    )
    monkeypatch.setattr(cameras, "focus_of", lambda _: None)
    with pytest.raises(ValueError, match="whole: crops: the views share no points"):
        poses.main(config, tmp_path / "none", *given)
    assert not (tmp_path / "none" / "poses.json").exists()
