"""Where a view sees another's patch: by projection, to first order."""

import numpy as np
import pytest

from alignerf.keypoints import alignment, tracks
from tests.alignerf.keypoints import made


@pytest.fixture
def scene(rng):
    xyz = made.points_on(rng, 200)
    model = made.model_of(*made.poses(), xyz, rng, noise_px=0.0)
    views = tracks.views_of(model)
    return tracks.tracks_of(model, views), views


def test_projections_are_the_keypoints(scene):
    found, views = scene
    seen = views.project(found.view, found.xyz[found.track])
    np.testing.assert_allclose(seen, found.xy, atol=1e-9)
    behind = 2 * views.centres[found.view] - found.xyz[found.track]
    assert np.isnan(views.project(found.view, behind)).all()


def test_each_track_has_a_reference_of_its_own(scene):
    found, _ = scene
    assert (found.track[found.reference] == np.arange(len(found.ids))).all()
    assert found.is_reference.sum() == len(found.ids)


def test_a_slope_makes_the_facing_plane_the_surfaces_own(scene):
    """The affine of the true plane is that of the facing one with one slope a track."""
    found, views = scene
    warps = tracks.warps_of(found, views)
    np.testing.assert_allclose(warps.predicted, found.xy, atol=1e-6)
    own, step = found.own, 1e-4
    normal = np.eye(3)[(found.ids[found.track] - 1) % 3]
    across = np.roll(normal, 1, axis=1), np.roll(normal, 2, axis=1)
    xyz = found.xyz[found.track]
    there, here = (
        np.stack(
            [(views.project(view, xyz + step * one) - xy) / step for one in across],
            axis=-1,
        )
        for view, xy in (
            (found.view, found.xy),
            (found.view[own], found.xy[own]),
        )
    )
    true = there @ tracks.inverted(here)
    more = true - warps.affine
    # [o, 2, 2] = slope of the view times that of the surface.
    own_slope = np.einsum("oi,oij->oj", warps.slope, more)
    own_slope /= (warps.slope**2).sum(axis=1, keepdims=True) + 1e-30
    seen = ~found.is_reference
    left = more - warps.slope[:, :, None] * own_slope[:, None, :]
    assert np.abs(left[seen]).max() < 1e-3 * max(1, np.abs(more[seen]).max())
    for track in range(0, len(found.ids), 10):
        same = own_slope[seen & (found.track == track)]
        np.testing.assert_allclose(
            same, np.broadcast_to(same[0], same.shape), rtol=0.02
        )


def test_parts_cut_no_track():
    track = np.repeat(np.arange(7), [3, 5, 1, 1, 8, 2, 2])
    found = alignment.parts(track, 6)
    assert [one.start for one in found[1:]] == [one.stop for one in found[:-1]]
    assert (found[0].start, found[-1].stop) == (0, len(track))
    for one in found[1:]:
        assert track[one.start] != track[one.start - 1]
    assert alignment.parts(track, 1000) == [slice(0, len(track))]
