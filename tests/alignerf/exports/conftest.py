"""Scenes that exports are made of."""

import numpy as np
import pytest

from alignerf import poses
from alignerf.colmap import loading
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.io import images
from alignerf.scenes import prepared
from tests import courtyard_photos
from tests import export_cases as cases


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """A prepared courtyard at half the size of its photos."""
    folder = tmp_path_factory.mktemp("made") / "yard"
    poses.main(cases.OF_COURTYARD, folder)
    return folder


@pytest.fixture(scope="session")
def views(made, tmp_path_factory):
    """Its views at full size, whose photos can be read."""
    config = of_scenes.checked(cases.OF_COURTYARD)
    return loading.read(config, made, tmp_path_factory.mktemp("work"))


@pytest.fixture(scope="session")
def photos(tmp_path_factory):
    """A folder of twelve neighbouring photos with masks."""
    folder = tmp_path_factory.mktemp("photos")
    names, *_ = courtyard_photos.write(folder, 12)
    mask = np.full((180, 240, 3), 255, np.uint8)
    mask[:, :20] = 0
    (folder / "masks").mkdir()
    for name in names:
        images.write(folder / "masks" / f"{name}.png", mask)
    return folder


@pytest.fixture(scope="session")
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
        loading.read(whole, folder / "scene", folder / "work"),
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
