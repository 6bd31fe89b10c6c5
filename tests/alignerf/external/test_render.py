"""Renders of other programs: what is taken, and each fault by its file."""

import logging
import shutil

import cv2
import numpy as np
import pytest

from alignerf.external import render
from alignerf.io import archives, faults, images
from alignerf.judged import depths
from alignerf.scenes import cameras, prepared

BOTH = ["train", "test"]


@pytest.fixture
def take(loaded, theirs, tmp_path):
    """Take the renders of some splits; returns the folder that is written."""

    def run(depth=None, splits=BOTH, scene=loaded):
        out = tmp_path / "out"
        of_view = render.of_folders(theirs, depth, scene, splits)
        words = [f"--{n}={out}/{n}" for n in ("renders", "depth", "timing")]
        words += [f"--scene={scene.folder}", "--splits", *splits]
        given = faults.arguments(words, None, render.OPTIONS)
        render.write(given, scene, of_view, 0.0)
        return out

    return run


def split_of(loaded):
    return zip(loaded.names, loaded.split.tolist(), strict=True)


def test_images_go_where_ours_would_be(take, theirs, loaded):
    out = take()
    for name, split in split_of(loaded):
        found = images.read(out / "renders" / split / f"{name}.png", size=(60, 44))
        wanted = cv2.imread(str(theirs / f"{name}.png"))[..., ::-1]
        np.testing.assert_array_equal(found, wanted)
        path = out / "depth" / split / f"{name}.npz"
        assert np.isposinf(archives.read(path, ["depth"])["depth"]).all()


def test_folders_and_other_suffixes_are_looked_into(take, theirs, loaded):
    name = loaded.names[0]
    photo = cv2.imread(str(theirs / f"{name}.png"))
    (theirs / f"{name}.png").unlink()
    (theirs / "test" / "rgb").mkdir(parents=True)
    cv2.imwrite(str(theirs / "test" / "rgb" / f"{name}.JPG"), photo)
    (theirs / "notes.txt").write_text("no image")
    found = images.read(take() / "renders" / "test" / f"{name}.png")
    assert np.abs(found[..., ::-1].astype(int) - photo).mean() < 10


def test_only_the_views_that_are_asked_for_have_to_be_there(take, theirs, loaded):
    for name, split in split_of(loaded):
        if split == "train":
            (theirs / f"{name}.png").unlink()
    out = take(splits=["test"])
    assert not (out / "renders" / "train").exists()
    with pytest.raises(ValueError, match=r"6 of 8 views are missing: .* and 3 more"):
        take()
    # What was there stays as it is.
    assert sorted(path.name for path in out.iterdir()) == ["depth", "renders", "timing"]


@pytest.mark.parametrize("unit", [1, 1000])
def test_depth_comes_into_the_units_of_the_scene(
    take, loaded, made, tmp_path, monkeypatch, unit
):
    monkeypatch.setattr(depths, "unit_of", lambda where, points, views: unit)
    monkeypatch.setattr(render, "points_of", lambda scene: [] if unit > 1 else None)
    folder = tmp_path / "depths"
    folder.mkdir()
    rng = np.random.default_rng(0)
    true = {name: rng.uniform(1, 9, (44, 60)) for name in loaded.names}
    for place, (name, depth) in enumerate(true.items()):
        if place % 2:
            np.save(folder / f"{name}.npy", depth)
        else:
            np.save(folder / f"{name}.npy", depth[..., None].astype(np.float32))
    true[loaded.names[0]][0, :2] = np.inf
    unknown = true[loaded.names[0]].copy()
    unknown[0, :2] = 0, np.nan
    np.save(folder / f"{loaded.names[0]}.npy", unknown)
    out = take(folder)
    own = prepared.read_cameras(made / "cameras.npz")
    scale = cameras.frame_of(own["camtoworlds"]).scale
    assert scale != pytest.approx(1, abs=0.01)
    for name, split in split_of(loaded):
        found = archives.read(out / "depth" / split / f"{name}.npz", ["depth"])["depth"]
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, scale / unit * true[name], rtol=1e-5)


def test_depth_of_some_views_only_is_a_fault(take, loaded, tmp_path):
    np.save(tmp_path / f"{loaded.names[0]}.npy", np.ones((44, 60)))
    with pytest.raises(ValueError, match="7 of 8 views are missing"):
        take(tmp_path)


@pytest.mark.parametrize("shape", [(44, 60, 3), (22, 30), (60, 44)])
def test_depth_of_another_shape_is_a_fault(take, loaded, tmp_path, shape):
    folder = tmp_path / "depths"
    folder.mkdir()
    for name in loaded.names:
        np.save(folder / f"{name}.npy", np.ones(shape))
    with pytest.raises(ValueError, match=f"{loaded.names[0]}|{loaded.names[1]}"):
        take(folder)


@pytest.mark.parametrize("size", [(61, 44), (59, 45), (60, 46)])
def test_sizes_that_rounding_made_are_said(take, theirs, loaded, caplog, size):
    path = theirs / f"{loaded.names[1]}.png"
    wanted = cv2.imread(str(path))
    cv2.imwrite(str(path), cv2.resize(wanted, size))
    with caplog.at_level(logging.WARNING):
        out = take()
    assert f"made 60x44 like the photos: {path.name}" in caplog.text
    found = images.read(out / "renders" / "train" / path.name, size=(60, 44))
    assert np.abs(found[..., ::-1].astype(int) - wanted).mean() < 12


@pytest.mark.parametrize("size", [(30, 22), (120, 88), (60, 48), (44, 60)])
def test_other_sizes_are_faults_with_both(take, theirs, loaded, size):
    path = theirs / f"{loaded.names[1]}.png"
    cv2.imwrite(str(path), cv2.resize(cv2.imread(str(path)), size))
    message = f"{path}: {size[0]}x{size[1]} pixels, not 60x44"
    with pytest.raises(ValueError, match=message):
        take()


def test_an_image_is_whole_shows_something_and_is_there_once(take, theirs, loaded):
    first, second = (theirs / f"{name}.png" for name in loaded.names[1:3])
    whole = first.read_bytes()
    first.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match=f"cannot decode {first}"):
        take()
    cv2.imwrite(str(first), np.full((44, 60, 3), 7, np.uint8))
    with pytest.raises(ValueError, match=f"{first}: an empty image"):
        take()
    first.write_bytes(second.read_bytes())
    with pytest.raises(ValueError, match=f"{second}: the same image as {first}"):
        take()
    first.write_bytes(whole)
    (theirs / "again").mkdir()
    shutil.copy(first, theirs / "again")
    with pytest.raises(ValueError, match=f"both of view {first.stem}"):
        take()
    shutil.rmtree(theirs)
    with pytest.raises(ValueError, match="theirs: 8 of 8 views are missing"):
        take()


def test_two_views_of_one_camera_may_show_the_same(take, theirs, loaded, made):
    arrays = prepared.read_cameras(made / "cameras.npz")
    for key in ("pixtocams", "camtoworlds"):
        arrays[key][2] = arrays[key][1]
    np.savez(theirs / "cameras.npz", **arrays)
    first, second = (theirs / f"{name}.png" for name in loaded.names[1:3])
    second.write_bytes(first.read_bytes())
    take(scene=prepared.load(made, theirs / "cameras.npz"))
