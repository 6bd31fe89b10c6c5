"""flow.align as a command."""

import csv
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from alignerf.io import images, owned
from flow import align
from flow.warping import files, warp

ROOT = Path(__file__).parents[2]
SHIFT_PX = (2, -1)


@pytest.fixture
def scene(tmp_path):
    """Three photos, and renders that see each 2 px further right and 1 px up."""
    rng = np.random.default_rng(0)
    dx, dy = SHIFT_PX
    for view in ("a", "b c", "d"):
        large = cv2.GaussianBlur(rng.normal(size=(70, 90, 3)), (0, 0), 1.5)
        large = np.clip(127 + 40 * large / large.std(), 0, 255).astype(np.uint8)
        photo = large[5:65, 5:85]
        render = large[5 + dy : 65 + dy, 5 + dx : 85 + dx]
        images.write(tmp_path / "photos" / f"{view}.png", photo)
        images.write(tmp_path / "renders" / f"{view}.png", render)
    return tmp_path


def arguments(scene, *more):
    return [
        *("--renders", str(scene / "renders"), "--photos", str(scene / "photos")),
        *("--flow-out", str(scene / "out" / "flow")),
        *("--warped-out", str(scene / "out" / "warped")),
        *("--stats-out", str(scene / "out" / "stats.csv")),
        *more,
    ]


def rows(scene):
    with open(scene / "out" / "stats.csv", newline="") as file:
        return list(csv.DictReader(file))


def names(folder):
    return sorted(path.name for path in folder.glob("[!.]*"))


def test_aligns_a_folder(scene):
    assert align.run(arguments(scene)) == 0
    assert names(scene / "out") == ["flow", "stats.csv", "warped"]
    for row, view in zip(rows(scene), ("a", "b c", "d"), strict=True):
        assert row["view"] == view
        assert float(row["median_px"]) == pytest.approx(5**0.5, abs=0.1)
        assert 0.8 < float(row["valid_fraction"]) <= 1
        flow_px, valid = files.read_flow(scene / "out" / "flow" / f"{view}.npz")
        assert float(row["valid_fraction"]) == pytest.approx(valid.mean())
        assert np.abs(np.median(flow_px[valid], axis=0) - SHIFT_PX).max() < 0.1
        photo = images.read(scene / "photos" / f"{view}.png")
        render = images.read(scene / "renders" / f"{view}.png").astype(int)
        warped = images.read(scene / "out" / "warped" / f"{view}.png")
        np.testing.assert_array_equal(warped, warp.warp(photo, flow_px))
        missed = np.abs(warped - render)[valid].mean()
        assert missed < 0.2 * np.abs(photo - render)[valid].mean()


def write_depth(scene, depth):
    (scene / "depth").mkdir()
    for view in ("a", "b c", "d"):
        np.savez(scene / "depth" / f"{view}.npz", depth=np.float32(depth))


def test_what_does_not_count_in_the_photo_is_not_valid_and_pulls_nothing(scene):
    """Garbage behind a mask changes no flow outside, and no pixel that leads there."""
    for view in ("a", "b c", "d"):
        photo = images.read(scene / "photos" / f"{view}.png")
        counts = np.ones(photo.shape[:2], bool)
        counts[:, 60:] = False
        photo[~counts] = 0
        images.write(scene / "photos" / f"{view}.png", photo)
        (scene / "masks").mkdir(exist_ok=True)
        np.savez_compressed(scene / "masks" / f"{view}.npz", valid=counts)
    assert align.run(arguments(scene, "--masks", str(scene / "masks"))) == 0
    for view in ("a", "b c", "d"):
        flow_px, valid = files.read_flow(scene / "out" / "flow" / f"{view}.npz")
        # A render's pixel is seen 2 px further right in the photo.
        assert not valid[:, 60:].any()
        inner = valid[6:-6, 6:50]
        assert inner.mean() > 0.9
        middle = np.median(flow_px[6:-6, 6:50].reshape(-1, 2), axis=0)
        np.testing.assert_allclose(np.abs(middle), np.abs(SHIFT_PX), atol=0.1)


def test_a_folder_of_masks_that_is_not_there_hides_nothing(scene):
    assert align.run(arguments(scene)) == 0
    plain = (scene / "out/flow/a.npz").read_bytes()
    shutil.rmtree(scene / "out")
    assert align.run(arguments(scene, "--masks", str(scene / "none"))) == 0
    assert (scene / "out/flow/a.npz").read_bytes() == plain


def test_a_mask_of_another_size_is_named(scene, capsys):
    (scene / "masks").mkdir()
    for view in ("a", "b c", "d"):
        np.savez(scene / "masks" / f"{view}.npz", valid=np.ones((3, 4), bool))
    assert align.run(arguments(scene, "--masks", str(scene / "masks"))) == 1
    assert "a.npz: valid is not of its photo's size" in capsys.readouterr().err
    assert not [path for path in (scene / "out").rglob("*") if path.is_file()]


def test_what_is_occluded_is_not_valid(scene, monkeypatch):
    assert align.run(arguments(scene)) == 0
    before = {v: files.read_flow(scene / "out/flow" / f"{v}.npz") for v in ("a", "d")}
    write_depth(scene, np.ones((60, 80)))
    # Whatever the flow: the half that the depth hides.
    hidden = np.indices((60, 80))[1] < 40

    def unoccluded(flow_px, depth):
        assert depth.shape == flow_px.shape[:2]
        return ~hidden

    monkeypatch.setattr(warp, "unoccluded", unoccluded)
    assert align.run(arguments(scene, "--depth", str(scene / "depth"))) == 0
    for view, (flow_px, valid) in before.items():
        again_px, again = files.read_flow(scene / "out/flow" / f"{view}.npz")
        np.testing.assert_array_equal(again_px, flow_px)
        np.testing.assert_array_equal(again, valid & ~hidden)


@pytest.mark.parametrize(
    ("depth", "reason"),
    [
        (None, "depth/a.npz"),
        (np.ones((9, 9)), "view a: depth"),
        (np.zeros((60, 80)), "view a: depth"),
    ],
)
def test_a_bad_depth_is_named(scene, capsys, depth, reason):
    if depth is not None:
        write_depth(scene, depth)
    assert align.run(arguments(scene, "--depth", str(scene / "depth"))) == 1
    error = capsys.readouterr().err
    (line,) = [line for line in error.splitlines() if line.startswith("error: ")]
    assert reason in line
    assert not (scene / "out" / "stats.csv").exists()


def test_runs_again_over_its_own_output_and_alike(scene):
    assert align.run(arguments(scene)) == 0
    first = (scene / "out" / "flow" / "a.npz").read_bytes()
    (scene / "out" / "flow" / "stale.npz").write_text("of an older run")
    owned.seal(scene / "out" / "flow")
    assert align.run(arguments(scene)) == 0
    assert names(scene / "out" / "flow") == ["a.npz", "b c.npz", "d.npz"]
    assert names(scene / "out") == ["flow", "stats.csv", "warped"]
    again = files.read_flow(scene / "out" / "flow" / "a.npz")
    (scene / "first.npz").write_bytes(first)
    for found, expected in zip(
        again, files.read_flow(scene / "first.npz"), strict=True
    ):
        np.testing.assert_array_equal(found, expected)


def test_the_photo_is_warped_as_it_is_not_as_blurred_for_the_flow(scene):
    for path in (scene / "renders").iterdir():
        blurred = cv2.GaussianBlur(images.read(path), (0, 0), 2.0)
        images.write(path, blurred)
    assert align.run(arguments(scene)) == 0
    for row in rows(scene):
        assert float(row["blur_sigma_px"]) == 2.0
        warped = images.read(scene / "out" / "warped" / f"{row['view']}.png")
        photo = images.read(scene / "photos" / f"{row['view']}.png")
        inner = np.s_[8:-8, 8:-8]
        assert warped[inner].std() == pytest.approx(photo[inner].std(), rel=0.1)
    assert align.run(arguments(scene, "--no-match-blur")) == 0
    assert {row["blur_sigma_px"] for row in rows(scene)} == {"0.0"}


def lose_photo(scene):
    (scene / "photos" / "b c.png").unlink()


def lose_renders(scene):
    for path in (scene / "renders").iterdir():
        path.unlink()


def lose_folder(scene):
    (scene / "photos").rename(scene / "elsewhere")


def cut_photo(scene):
    path = scene / "photos" / "b c.png"
    path.write_bytes(path.read_bytes()[:200])


def resize_photo(scene):
    path = scene / "photos" / "b c.png"
    images.write(path, images.read(path)[:-1])


def shrink_all(scene):
    for path in scene.glob("*/*.png"):
        images.write(path, images.read(path)[:20])


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lose_photo, "photos/b c.png: no photo for render"),
        (lose_renders, "renders: no renders"),
        (lose_folder, "photos: no such folder"),
        (cut_photo, "photos/b c.png: image file is truncated"),
        (resize_photo, "view b c: render and photo differ in size: 80x60"),
        (shrink_all, "view a: images of 80x20 pixels are too small"),
    ],
)
def test_bad_folders_end_in_one_line_and_nothing_written(scene, capsys, damage, reason):
    damage(scene)
    assert align.run(arguments(scene)) == 1
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("error: ")
    assert reason in error
    assert not list(scene.glob("out/**/*"))


@pytest.mark.parametrize("lost", [["a"], ["a", "b c", "d"]])
def test_a_view_without_a_valid_flow_is_left_out(scene, caplog, capsys, lost):
    """Its photo, of which nothing counts, stays as it is."""
    (scene / "masks").mkdir()
    for view in ("a", "b c", "d"):
        counts = np.full((60, 80), view not in lost)
        np.savez(scene / "masks" / f"{view}.npz", valid=counts)
    code = align.run(arguments(scene, "--masks", str(scene / "masks")))
    if len(lost) == 3:
        assert code == 1
        assert "no view has a valid flow" in capsys.readouterr().err
        return
    assert code == 0
    assert len(caplog.messages) == 1
    assert "no pixel has a valid flow in a: " in caplog.messages[0]
    first, *others = rows(scene)
    assert (first["median_px"], float(first["valid_fraction"])) == ("", 0)
    assert all(float(row["valid_fraction"]) > 0.8 for row in others)
    # What does not count is the render's.
    render = images.read(scene / "renders" / "a.png")
    np.testing.assert_array_equal(images.read(scene / "out/warped/a.png"), render)


def test_without_a_folder_for_them_no_photos_are_warped(scene):
    assert align.run(arguments(scene)) == 0
    with_them = rows(scene)
    flow_px, _ = files.read_flow(scene / "out" / "flow" / "a.npz")
    shutil.rmtree(scene / "out")
    options = arguments(scene)
    at = options.index("--warped-out")
    assert align.run(options[:at] + options[at + 2 :]) == 0
    assert names(scene / "out") == ["flow", "stats.csv"]
    for row, other in zip(rows(scene), with_them, strict=True):
        assert row | {"time_s": ""} == other | {"time_s": ""}
    again_px, _ = files.read_flow(scene / "out" / "flow" / "a.npz")
    np.testing.assert_array_equal(again_px, flow_px)


def test_both_splits_are_aligned_as_each_alone(scene):
    assert align.run(arguments(scene)) == 0
    (scene / "renders").rename(scene / "train")
    (scene / "renders").mkdir()
    (scene / "train").rename(scene / "renders" / "train")
    shutil.copytree(scene / "renders" / "train", scene / "renders" / "test")
    (scene / "renders" / "test" / "b c.png").unlink()
    both = scene / "both"
    options = [
        *("--splits", "train", "test", "--photos", str(scene / "photos")),
        *("--renders", str(scene / "renders")),
        *(f"--{name}-out={both / name}" for name in ("flow", "warped", "stats")),
        *("--oracle", str(scene / "photos")),
    ]
    assert align.run(options) == 0
    for split, views in {"train": ["a", "b c", "d"], "test": ["a", "d"]}.items():
        for kind in ("flow", "warped"):
            found = {p.stem: p for p in (both / kind / split).glob("[!.]*")}
            assert sorted(found) == views
            for view, path in found.items():
                alone = scene / "out" / kind / path.name
                if kind == "warped":
                    assert path.read_bytes() == alone.read_bytes(), view
                else:
                    pair = files.read_flow(path), files.read_flow(alone)
                    for one, other in zip(*pair, strict=True):
                        np.testing.assert_array_equal(one, other)
        with open(both / "stats" / f"{split}.csv", newline="") as file:
            assert [row["view"] for row in csv.DictReader(file)] == views
    # Of the test views, to images that count everywhere.
    for view in ("a", "d"):
        found = files.read_flow(both / "flow" / "oracle" / f"{view}.npz")
        alone = files.read_flow(both / "flow" / "test" / f"{view}.npz")
        np.testing.assert_array_equal(found[0], alone[0])
    assert (both / "stats" / "oracle.csv").is_file()
