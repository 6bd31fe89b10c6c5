"""Which keypoints have a say, and views that the others place."""

import numpy as np
import pycolmap
import pytest

from alignerf.keypoints import adjustment
from tests.alignerf.keypoints import made


@pytest.fixture
def model(rng):
    xyz = made.points_on(rng, 1500)
    return made.model_of(*made.poses(), xyz, rng, noise_px=0.05)


def keypoints_of(image):
    return np.array([p.xy for p in image.points2D if p.has_point3D()])


def test_each_cell_of_a_view_has_one_keypoint(model, monkeypatch):
    monkeypatch.setattr(adjustment, "MIN_KEYPOINTS", 0)
    adjustment.thin_out(model)
    side = made.WIDTH / adjustment.CELLS
    for image in model.images.values():
        cells = np.floor(keypoints_of(image) / side)
        assert len(np.unique(cells, axis=0)) == len(cells) > 40


def test_a_view_of_few_cells_has_more_of_each(model):
    adjustment.thin_out(model)
    for image in model.images.values():
        assert len(keypoints_of(image)) >= 0.8 * adjustment.MIN_KEYPOINTS


def test_a_view_that_follows_what_moves_is_placed_by_the_others(rng):
    """Half of a view's keypoints are on a thing that has moved, in one place."""
    turns, centres = made.poses()
    still = made.points_on(rng, 400)
    moving = np.array([0.9, 1.0, 0]) + rng.uniform(-0.18, 0.18, (700, 3)) * [1, 1, 0]
    xyz = np.concatenate([still, moving])
    model = made.model_of(turns, centres, xyz, rng, noise_px=0.05)
    view = 4
    image = model.images[view]
    for point in image.points2D:
        if point.has_point3D() and point.point3D_id > len(still):
            point.xy += np.array([4.0, -3.0])
    # As it is where the moving thing decides.
    wrong = pycolmap.Rigid3d(
        image.cam_from_world().rotation, image.cam_from_world().translation
    )
    wrong.translation += np.array([0.05, -0.04, 0])
    image.frame.set_cam_from_world(1, wrong)
    placed = adjustment.adjust(model, "", seed=0)
    assert made.error_px(model, turns, centres, xyz).max() < 0.15
    assert set(placed) <= {view}


def test_points_without_a_say_move_no_camera(model):
    """Even where they are wrong."""
    held = sorted(model.points3D)[::5]
    for number in held:
        for one in model.points3D[number].track.elements:
            point = model.images[one.image_id].points2D[one.point2D_idx]
            point.xy += np.array([2.0, 0.0])
    without = pycolmap.Reconstruction(model)
    for number in held:
        without.delete_point3D(number)
    adjustment.adjust(model, "", without=held)
    adjustment.adjust(without, "")
    for number, image in without.images.items():
        np.testing.assert_array_equal(
            image.cam_from_world().matrix(),
            model.images[number].cam_from_world().matrix(),
        )


def test_rank_in_group():
    ranks = adjustment.rank_in_group(
        np.array([1, 1, 1, 2, 2]), np.array([0, 0, 5, 5, 5])
    )
    assert ranks.tolist() == [0, 1, 0, 0, 1]


def test_a_lens_that_few_views_tell_of_stays(model, monkeypatch):
    assert adjustment.unsure_lenses(model) == []
    before = model.cameras[1].params.copy()
    adjustment.adjust(model, "centre")
    assert (model.cameras[1].params != before).all()
    monkeypatch.setattr(adjustment, "MIN_VIEWS", len(model.images) + 1)
    assert adjustment.unsure_lenses(model) == [1]
    before = model.cameras[1].params.copy()
    adjustment.adjust(model, "centre")
    np.testing.assert_array_equal(model.cameras[1].params, before)
