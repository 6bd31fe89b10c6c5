"""A prepared scene, and another program's renders of it."""

import cv2
import pytest

from alignerf import poses
from alignerf.scenes import prepared

MADE = {
    "source": "courtyard",
    "poses": "truth",
    "test_every": 4,
    "perturb_px": 1.0,
    "courtyard": {"views": 8, "width": 60, "height": 44, "supersample": 1},
}


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """The folder of a small courtyard."""
    folder = tmp_path_factory.mktemp("others") / "yard"
    poses.main(MADE, folder)
    return folder


@pytest.fixture
def loaded(made):
    return prepared.load(made)


@pytest.fixture
def theirs(made, loaded, tmp_path):
    """A folder of renders: the photos, blurred."""
    folder = tmp_path / "theirs"
    folder.mkdir()
    for name in loaded.names:
        photo = cv2.imread(str(made / "images" / f"{name}.png"))
        cv2.imwrite(str(folder / f"{name}.png"), cv2.GaussianBlur(photo, (0, 0), 1))
    return folder
