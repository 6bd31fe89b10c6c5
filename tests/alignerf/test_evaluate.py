"""Scores of views: what is measured, and what is left empty and why."""

import itertools
import shutil

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from alignerf import evaluate, testsets
from alignerf.io import images
from alignerf.metrics import image as image_metrics
from alignerf.metrics import lpips
from alignerf.scenes import cameras
from flow.warping import files

SIZE = (40, 48)


@pytest.fixture
def pair(rng):
    target = rng.integers(0, 256, (*SIZE, 3), dtype=np.uint8)
    noise = rng.integers(-20, 21, target.shape)
    return target, np.clip(target + noise, 0, 255).astype(np.uint8)


EVERYWHERE = np.ones(SIZE, bool)


def test_scores_are_the_metrics(pair):
    row = evaluate.score(*pair, EVERYWHERE, {"mine": lambda *_: 0.5})
    assert row["psnr_db"] == image_metrics.psnr_db(*pair, EVERYWHERE)
    assert row["ssim"] == image_metrics.ssim(*pair, EVERYWHERE)
    assert row["mine"] == 0.5
    assert (row["valid_fraction"], row["note"]) == (1.0, "")


def test_identical_images_are_flagged_and_not_averaged(pair):
    target, _ = pair
    row = evaluate.score(target, target, EVERYWHERE, {})
    assert np.isnan(row["psnr_db"])
    assert row["ssim"] == pytest.approx(1.0)
    assert row["note"] == "psnr_db: identical images"


@pytest.fixture
def learned(monkeypatch):
    """LPIPS with a network that only remembers what it is shown."""
    shown = []

    def distance(net, weights, first, second):
        shown.append((net, weights, np.asarray(first), np.asarray(second)))
        return np.array([0.25])

    monkeypatch.setattr(lpips, "read", lambda net, path: f"{net} of {path}")
    monkeypatch.setattr(lpips, "distance", distance)
    return image_metrics.learned({"vgg": "a.npz", "alex": None}), shown


def test_pixels_that_are_not_valid_change_nothing(pair, learned):
    target, render = pair
    valid = EVERYWHERE.copy()
    valid[5:30, 7:20] = False
    spoilt = np.where(valid[..., None], target, 255 - target)
    named, shown = learned
    rows = [evaluate.score(t, render, valid, named) for t in (target, spoilt)]
    assert rows[0] == rows[1]
    assert rows[0]["lpips_vgg"] == 0.25
    assert rows[0]["valid_fraction"] == valid.mean() < 1
    for net, weights, first, second in shown:
        assert (net, weights) == ("vgg", "vgg of a.npz")
        filled = np.where(valid[..., None], target, render)
        np.testing.assert_allclose(first[0], filled / 255.0, atol=1e-7)
        np.testing.assert_allclose(second[0], render / 255.0, atol=1e-7)
    assert rows[0]["psnr_db"] != evaluate.score(*pair, EVERYWHERE, {})["psnr_db"]


def test_images_too_small_for_a_metric_say_so(pair, monkeypatch):
    target, render = (image[:30, :30] for image in pair)
    valid = np.ones((30, 30), bool)
    monkeypatch.setattr(lpips, "read", lambda net, path: {})
    learned = image_metrics.learned({"alex": "a.npz"})
    row = evaluate.score(target, render, valid, learned)
    assert np.isnan(row["lpips_alex"])
    assert row["note"] == "lpips_alex: under 31 pixels"
    row = evaluate.score(target[:10], render[:10], valid[:10], {})
    assert np.isnan(row["ssim"])
    assert np.isfinite(row["psnr_db"])
    assert "under 11" in row["note"]


def test_a_view_without_valid_pixels_has_no_score(pair):
    row = evaluate.score(*pair, np.zeros(SIZE, bool), {"lpips_alex": None})
    assert np.isnan([row[name] for name in ("psnr_db", "ssim", "lpips_alex")]).all()
    assert row["note"] == "no valid pixel"


def test_valid_at_the_border_only_leaves_ssim_empty(pair):
    valid = np.zeros(SIZE, bool)
    valid[0] = True
    row = evaluate.score(*pair, valid, {})
    assert np.isfinite(row["psnr_db"])
    assert np.isnan(row["ssim"])
    assert "ssim: no valid pixel away from the border" in row["note"]


WARPED = (
    *("warped", "control", "placebo", "crossfit"),
    *("aligned", "overfit", "overfit_crossfit"),
)


@pytest.fixture
def folder(tmp_path, rng):
    """A scene of four views with a warped test set; two are test views."""
    names = ["a", "b", "c", "d"]
    poses = np.repeat(np.eye(4)[None, :3], 4, axis=0)
    poses[:, :, 3] = rng.normal(size=(4, 3))
    np.savez(
        tmp_path / "cameras.npz",
        pixtocams=np.stack([cameras.intrinsics(30.0, SIZE[1], SIZE[0])] * 4),
        camtoworlds=poses,
        names=names,
        width=SIZE[1],
        height=SIZE[0],
        split=["test", "train", "test", "train"],
    )
    for view in ("a", "c"):
        for kind in ("images", "renders", *(f"testset/{name}" for name in WARPED)):
            image = rng.integers(0, 256, (*SIZE, 3), dtype=np.uint8)
            images.write(tmp_path / kind / f"{view}.png", image)
        for name in ("flow", "overfit_flow"):
            valid = rng.uniform(size=SIZE) < 0.7
            flow_px = np.zeros((*SIZE, 2), np.float32)
            files.write_flow(
                tmp_path / "testset" / name / f"{view}.npz", flow_px, valid
            )
    return tmp_path


def run(folder, *more, aligned_pose=None):
    options = {"scene": "", "renders": "renders", "testset": "testset"}
    if aligned_pose:
        options = {"scene": "", "aligned-pose": aligned_pose}
    arguments = [f"--{key}={folder / value}" for key, value in options.items()]
    evaluate.main([*arguments, f"--metrics={folder / 'metrics.csv'}", *more])
    return pd.read_csv(folder / "metrics.csv").set_index(["view", "test_set"])


def test_each_test_set_is_scored_against_its_own_images(folder):
    found = run(folder)
    assert list(found.index.unique("view")) == ["a", "c"]
    for view in ("a", "c"):
        render = images.read(folder / "renders" / f"{view}.png")
        valid, overfit_valid = (
            files.read_flow(folder / "testset" / name / f"{view}.npz")[1]
            for name in ("flow", "overfit_flow")
        )
        assert (valid != overfit_valid).any()
        for test_set, (kind, mask) in {
            "standard": ("images", EVERYWHERE),
            "standard_valid": ("images", valid),
            "warped": ("testset/warped", valid),
            "control": ("testset/control", EVERYWHERE),
            "placebo": ("testset/placebo", EVERYWHERE),
            "crossfit": ("testset/crossfit", valid),
            "aligned": ("testset/aligned", overfit_valid),
            "overfit": ("testset/overfit", overfit_valid),
            "overfit_crossfit": ("testset/overfit_crossfit", overfit_valid),
        }.items():
            target = images.read(folder / kind / f"{view}.png")
            row = found.loc[view, test_set]
            assert row["psnr_db"] == pytest.approx(
                image_metrics.psnr_db(target, render, mask)
            )
            assert row["valid_fraction"] == pytest.approx(mask.mean())
            assert row["note"] == "lpips_alex, lpips_vgg: no weights given"
    assert "oracle" not in found.index.unique("test_set")


def test_the_oracle_where_the_truth_is_known(folder):
    (folder / "truth").mkdir()
    (folder / "renders").rename(folder / "truth" / "oracle")
    for view in ("a", "c"):
        image = np.zeros((*SIZE, 3), np.uint8)
        images.write(folder / "renders" / f"{view}.png", image)
    found = run(folder, f"--truth={folder / 'truth'}")
    oracle = images.read(folder / "truth" / "oracle" / "a.png")
    wanted = image_metrics.psnr_db(oracle, np.zeros_like(oracle), EVERYWHERE)
    assert found.loc["a", "oracle"]["psnr_db"] == pytest.approx(wanted)


MOVED = [one.name for one in testsets.every() if one.moved]


def test_moved_cameras_are_scored_by_their_own_renders(folder, rng):
    """Against the photo, and the overfit against the oracle."""
    (folder / "truth").mkdir()
    (folder / "testset" / "aligned").rename(folder / "truth" / "oracle")
    shutil.copytree(folder / "truth" / "oracle", folder / "testset" / "aligned")
    for view in ("a", "c"):
        for name in MOVED:
            image = rng.integers(0, 256, (*SIZE, 3), dtype=np.uint8)
            images.write(folder / "moved" / name / f"{view}.png", image)
    errors_px = dict.fromkeys(itertools.product("ac", MOVED, range(2)), 0.4)
    errors_px["a", "aligned_pose", 1] = 0.7
    errors_px["a", "aligned_pose_overfit", 0] = None
    poses = [(*key, error_px) for key, error_px in errors_px.items()]
    poses = pd.DataFrame(poses, columns=["view", "test_set", "half", "error_px"])
    poses.to_csv(folder / "moved" / "poses.csv", index=False)
    found = run(folder, f"--truth={folder / 'truth'}", aligned_pose="moved")
    assert set(found.index.unique("test_set")) == {*MOVED}
    # One half by an uncertain camera is enough.
    assert found.loc["a", "psnr_db"].isna().all()
    assert "open by 0.7 px" in found.loc["a", "aligned_pose"]["note"]
    assert "camera open;" in found.loc["a", "aligned_pose_overfit"]["note"]
    for name, kind in {
        "aligned_pose": "images",
        "aligned_pose_overfit": "truth/oracle",
    }.items():
        target = images.read(folder / kind / "c.png")
        render = images.read(folder / "moved" / name / "c.png")
        wanted = image_metrics.psnr_db(target, render, EVERYWHERE)
        assert found.loc["c", name]["psnr_db"] == pytest.approx(wanted)
        # Seams are no part of what is compared.
        assert np.isnan(found.loc["c", name]["ssim"])
    with pytest.raises(ValueError, match="gone"):
        run(folder, aligned_pose="gone")


def test_what_moves_and_what_stands_still_are_scored_apart(folder, rng):
    (folder / "truth" / "moving").mkdir(parents=True)
    (folder / "testset" / "aligned").rename(folder / "truth" / "oracle")
    shutil.copytree(folder / "truth" / "oracle", folder / "testset" / "aligned")
    moving = rng.uniform(size=SIZE) < 0.3
    np.savez(folder / "truth" / "moving" / "a.npz", moving=moving)
    np.savez(folder / "truth" / "moving" / "c.npz", moving=moving & False)
    found = run(folder, f"--truth={folder / 'truth'}")
    oracle, render = (
        images.read(folder / kind / "a.png") for kind in ("truth/oracle", "renders")
    )
    for name, mask in {"oracle_moving": moving, "oracle_still": ~moving}.items():
        wanted = image_metrics.psnr_db(oracle, render, mask)
        assert found.loc["a", name]["psnr_db"] == pytest.approx(wanted)
    # Nothing moves in the other view.
    assert found.loc["c", "oracle_still"]["valid_fraction"] == 1
    assert ("c", "oracle_moving") not in found.index


def test_without_a_warped_test_set_the_rest_is_scored(folder):
    both = run(folder)
    shutil.rmtree(folder / "testset")
    options = [f"--scene={folder}", f"--renders={folder / 'renders'}"]
    evaluate.main([*options, f"--metrics={folder / 'metrics.csv'}"])
    found = pd.read_csv(folder / "metrics.csv").set_index(["view", "test_set"])
    pd.testing.assert_frame_equal(found, both.loc[(slice(None), "standard"), :])


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("renders/c.png", "renders/c.png"),
        ("testset/flow/a.npz", "flow/a.npz"),
        ("testset/control/a.png", "control/a.png"),
        ("testset/crossfit/c.png", "crossfit/c.png"),
        ("testset/overfit_flow/c.npz", "overfit_flow/c.npz"),
    ],
)
def test_what_is_missing_is_named_and_nothing_written(folder, path, reason):
    (folder / path).unlink()
    with pytest.raises(ValueError, match=reason):
        run(folder)
    assert not (folder / "metrics.csv").exists()


@pytest.mark.whole
def test_the_network_whose_weights_are_given(folder, shared_data):
    path = shared_data / "weights" / "lpips_alex_v0.1.npz"
    found = run(folder, f"--lpips-alex={path}")
    assert tuple(found.columns) == evaluate.COLUMNS[2:]
    assert set(found["note"]) == {"lpips_vgg: no weights given"}
    assert found["lpips_vgg"].isna().all()
    pair = [
        images.read(folder / kind / "a.png")[None] / np.float32(255)
        for kind in ("images", "renders")
    ]
    wanted = float(lpips.distance("alex", lpips.read("alex", path), *pair)[0])
    assert found.loc["a", "standard"]["lpips_alex"] == pytest.approx(wanted)


def test_weights_that_are_none_are_named(folder):
    weights = folder / "weights.npz"
    np.savez(weights, conv1_w=np.zeros(3))
    with pytest.raises(ValueError, match=r"weights\.npz: .*conv1_b"):
        run(folder, f"--lpips-alex={weights}")
    Image.new("RGB", (9, 9)).save(folder / "renders" / "a.png")
    with pytest.raises(ValueError, match=r"a\.png: 9x9 pixels"):
        run(folder)
