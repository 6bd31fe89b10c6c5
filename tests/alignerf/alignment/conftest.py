"""A plane whose cameras are wrong by three pixels."""

import pytest

from tests import plane_scene as plane


@pytest.fixture
def wrong(tmp_path, rng):
    true = plane.poses_of(rng)
    loaded, seen = plane.make_scene(
        tmp_path / "scene", true, plane.turned(true, rng, 3.0)
    )
    return loaded, seen, tmp_path / "checkpoints"
