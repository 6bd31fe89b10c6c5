"""What another program learns from."""

import shutil

import numpy as np

from alignerf.external import train
from alignerf.io import faults, images
from alignerf.scenes import prepared
from tests import export_cases as cases


def written(made, out, **options):
    train.write_data(out / "data", made, **options)
    return out / "data"


def views_of(path):
    """The arrays of a cameras.npz as `check_cameras` compares them."""
    arrays = prepared.read_cameras(path)
    arrays["names"] = arrays["names"].tolist()
    arrays |= {key: int(arrays[key]) for key in ("width", "height")}
    return type("Views", (), arrays)


def test_all_photos_and_the_cameras_as_given(made, tmp_path):
    out = written(made, tmp_path)
    cases.check_cameras(out, views_of(made / "cameras.npz"))
    for path in sorted((made / "images").glob("*.png")):
        assert (out / "images" / path.name).read_bytes() == path.read_bytes()
    assert not (out / "masks").exists()


def test_a_round_has_its_own_cameras_and_photos(made, tmp_path, loaded):
    """Training views are warped, with a mask; test views are as taken."""
    arrays = prepared.read_cameras(made / "cameras.npz")
    train = arrays["split"] == "train"
    arrays["camtoworlds"][train, :, 3] += 0.01
    np.savez(tmp_path / "cameras.npz", **arrays)
    for folder in ("warped", "valid"):
        (tmp_path / folder).mkdir()
    for view in loaded.views("train"):
        name = loaded.names[view]
        photo = images.read(made / "images" / f"{name}.png")
        images.write(tmp_path / "warped" / f"{name}.png", 255 - photo)
        valid = np.ones((44, 60), bool)
        valid[:, :7] = False
        flow_px = np.zeros((44, 60, 2), np.float32)
        np.savez(tmp_path / "valid" / f"{name}.npz", valid=valid, flow_px=flow_px)
    out = written(
        *(made, tmp_path),
        cameras=tmp_path / "cameras.npz",
        warped=tmp_path / "warped",
        valid=tmp_path / "valid",
    )
    cases.check_cameras(out, views_of(tmp_path / "cameras.npz"))
    for name, split in zip(loaded.names, loaded.split.tolist(), strict=True):
        photo = images.read(made / "images" / f"{name}.png")
        found = images.read(out / "images" / f"{name}.png")
        wanted = 255 - photo if split == "train" else photo
        np.testing.assert_array_equal(found, wanted)
        mask = cases.read_mask(out / "masks" / f"{name}.png.png")
        assert mask[:, 7:].all()
        assert mask[:, :7].any() == (split == "test")


def test_a_broken_photo_is_named_and_nothing_is_left(made, tmp_path, loaded, capsys):
    copy = tmp_path / "scene"
    shutil.copytree(made, copy)
    broken = copy / "images" / f"{loaded.names[3]}.png"
    broken.write_bytes(b"no image")
    assert faults.exit_code(written, copy, tmp_path) == 1
    assert str(broken) in capsys.readouterr().err
    assert not (tmp_path / "data").exists()
