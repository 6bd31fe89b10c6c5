"""The object with a moving arm: before white, and where the arm is seen."""

import numpy as np
import pytest

from alignerf import poses
from alignerf.courtyard import scene as courtyard
from alignerf.courtyard import world as courtyard_world
from alignerf.io import images
from tests import courtyard_photos

ARM = {
    "place": "object",
    "views": 8,
    "width": 96,
    "height": 72,
    "motion": "two_states",
    "motion_m": 0.1,
    "moving": ["arm"],
    "lens_sigma_px": 0.7,
}
CONFIG = {"source": "courtyard", "poses": "truth", "courtyard": ARM}


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    out = tmp_path_factory.mktemp("results") / "arm"
    poses.main(CONFIG, out)
    return out


def test_an_object_stands_before_white():
    world = courtyard.build_world(seed=0, place="object")
    pixtocams, camtoworlds = courtyard.make_cameras(
        views=3, width=60, height=40, seed=0
    )
    for camera in zip(pixtocams, camtoworlds, strict=True):
        where = world, *camera, 60, 40, courtyard.at_rest()
        image, (_, object_id) = courtyard.render(*where), courtyard_photos.seen(*where)
        seen = {courtyard.OBJECTS[i] for i in np.unique(object_id)}
        assert {"sky", "arm"} < seen <= {"sky", *courtyard_world.OF_OBJECT}
        away = object_id == courtyard.OBJECTS.index("sky")
        assert (image[away] == 255).all(axis=-1).mean() > 0.7
        # The top row looks past all boxes.
        assert (image[0] == 255).all()


def test_what_differs_between_the_states_lies_under_the_mask(arm):
    """Of a photo and the oracle, which differ in the arm's state alone."""
    moved = 0
    for path in sorted((arm / "images").glob("*.png")):
        photo, oracle = (
            images.read(folder / path.name).astype(int)
            for folder in (
                arm / "images",
                arm / "images" / "truth" / "oracle",
            )
        )
        with np.load(
            arm / "images" / "truth" / "moving" / f"{path.stem}.npz"
        ) as stored:
            moving = stored["moving"]
        differs = np.abs(photo - oracle).max(axis=-1) > 3
        moved += differs.any()
        assert not (differs & ~moving).any()
        assert 0.01 < moving.mean() < 0.4
    assert 1 <= moved < 8


def test_other_motion_has_no_such_mask(tmp_path):
    for motion in ("none", "uniform"):
        changed = ARM | {"motion": motion, "views": 4}
        poses.main(CONFIG | {"courtyard": changed}, tmp_path / motion)
        assert not (tmp_path / motion / "images" / "truth" / "moving").exists()
