"""In-loop alignment: cameras and photos of a scene that is known exactly."""

import numpy as np
import pytest

from alignerf.alignment import aligner, look
from alignerf.io import images
from alignerf.methods import align
from alignerf.training import renderer
from tests import plane_scene as plane
from tests import training_cases as cases


def test_wrong_cameras_come_to_the_truth_and_the_frame_stays(wrong):
    loaded, true, folder = wrong
    found = plane.aligner_of(loaded, folder)
    before = plane.error_px(loaded, true)
    assert before > 1.5
    for step in found.places:
        found.align({}, step)
    assert plane.error_px(found.now, true) < 0.15 * before
    test = loaded.views("test")
    np.testing.assert_array_equal(found.now.camtoworlds[test], loaded.camtoworlds[test])
    # Its photo was taken by the held-out camera as it is given: the others have come to
    # where it sees them, not only to each other.
    assert plane.error_px(found.now, true, gauged=False) < 0.3 * before
    first, second = found.report
    assert first["cameras_moved"] == plane.COUNT - 1
    assert first["flow_px"] > 1.5 > second["flow_px"]
    assert second["corrects"] == ["cameras", "photos"]


def test_where_nothing_is_wrong_nothing_changes_at_all(tmp_path, rng):
    poses = plane.poses_of(rng)
    loaded, _ = plane.make_scene(tmp_path / "scene", poses, poses)
    found = plane.aligner_of(loaded, tmp_path / "checkpoints")
    for step in found.places:
        found.align({}, step)
    np.testing.assert_array_equal(found.now.camtoworlds, loaded.camtoworlds)
    given = plane.views_of(loaded)
    for old, new in zip(given, found.views(given), strict=True):
        np.testing.assert_array_equal(old, new)
    assert [row["cameras_moved"] for row in found.report] == [0, 0]
    (reason,) = found.report[0]["left_alone"]
    assert "that is the flow's error" in reason


@pytest.fixture
def looked_at(monkeypatch):
    """Indices of the views of each look; two of seven views may tell."""
    monkeypatch.setattr(aligner, "MIN_PROBED", 2)
    every, look_at = [], look.Looker.__call__

    def counted(self, params, now, wanted):
        every.append(list(wanted))
        return look_at(self, params, now, wanted)

    monkeypatch.setattr(look.Looker, "__call__", counted)
    return every


def test_where_some_views_show_nothing_wrong_only_the_last_look_is_at_all(
    tmp_path, rng, looked_at
):
    poses = plane.poses_of(rng)
    # One camera is wrong, and not among those that are looked at first.
    given = poses.copy()
    given[4] = plane.turned(poses[3:5], rng, 6.0)[1]
    loaded, _ = plane.make_scene(tmp_path / "scene", poses, given)
    found = plane.aligner_of(loaded, tmp_path / "checkpoints")
    for step in found.places:
        found.align({}, step)
    assert looked_at == [[0, 6], list(range(plane.COUNT - 1))]
    assert [row["views"] for row in found.report] == [2, plane.COUNT - 1]
    assert [row["cameras_moved"] for row in found.report] == [0, 1]


def test_the_last_look_for_cameras_is_at_all_though_photos_come_later(
    tmp_path, rng, looked_at
):
    poses = plane.poses_of(rng)
    loaded, _ = plane.make_scene(tmp_path / "scene", poses, poses)
    places = {"cameras_at": [0.2, 0.4], "photos_at": [0.6]}
    found = plane.aligner_of(loaded, tmp_path / "checkpoints", **places)
    for step in found.places:
        found.align({}, step)
    assert [len(wanted) for wanted in looked_at] == [
        2,
        plane.COUNT - 1,
        plane.COUNT - 1,
    ]


def test_where_some_views_show_a_fault_it_is_as_if_all_were_looked_at(
    wrong, looked_at, monkeypatch
):
    loaded, _, folder = wrong
    found = plane.aligner_of(loaded, folder)
    for step in found.places:
        found.align({}, step)
    assert looked_at == [[0, 6], [1, 2, 3, 4, 5], list(range(plane.COUNT - 1))]
    monkeypatch.setattr(aligner, "MIN_PROBED", plane.COUNT)
    whole = plane.aligner_of(loaded, folder)
    for step in whole.places:
        whole.align({}, step)
    np.testing.assert_array_equal(whole.now.camtoworlds, found.now.camtoworlds)
    np.testing.assert_array_equal(whole.offsets_px, found.offsets_px)


def test_a_thing_that_moved_is_brought_back_and_the_rest_stays(tmp_path, rng):
    """One photo shows a part elsewhere: its pixels alone are taken from there."""
    at = (slice(45, 99), slice(60, 120))

    def photo_of(i, photo):
        return photo if i != 3 else moved(photo)

    def moved(photo):
        new = photo.copy()
        new[at] = photo[45:99, 56:116]
        return new

    poses = plane.poses_of(rng)
    loaded, _ = plane.make_scene(tmp_path / "scene", poses, poses, photo_of)
    found = plane.aligner_of(loaded, tmp_path / "checkpoints")
    for step in found.places:
        found.align({}, step)
    given = plane.views_of(loaded)
    new = found.views(given)
    slot = 2  # of view 3 among the training views
    others = [i for i in range(plane.COUNT - 1) if i != slot]
    np.testing.assert_array_equal(new.photos[others], given.photos[others])
    truth = renderer.make_renderer(plane.METHOD, {}, plane.WIDTH, plane.HEIGHT)(
        loaded.pixtocams[3], loaded.camtoworlds[3]
    )[0]
    inside = (slice(57, 87), slice(72, 102))

    def error(photos):
        return np.abs(photos[slot][inside].astype(float) - truth[inside]).mean()

    assert error(new.photos) < 0.4 * error(given.photos)
    far = (slice(0, 27), slice(0, 180))
    np.testing.assert_array_equal(new.photos[slot][far], given.photos[slot][far])
    assert found.report[-1]["photos_warped"] == 1


def test_what_counts_as_the_flows_own_error_falls_with_the_training(wrong):
    """More while renders are blurred; less once cameras were seen to be wrong."""
    loaded, _, folder = wrong
    found = plane.aligner_of(loaded, folder, min_move_px=0.12)
    found.begin(100, "this")
    assert [round(found.min_px(step), 3) for step in (5, 10, 25, 60)] == [
        *(0.6, 0.3, 0.12, 0.12)
    ]
    found.report = [{"cameras_moved": 0}]
    assert found.min_px(50) == 0.12
    # One bad camera among good ones says nothing of the others.
    found.report = [{"cameras_moved": 1}]
    assert found.min_px(50) == 0.12
    found.report = [{"cameras_moved": plane.COUNT - 1}]
    assert found.min_px(10) == found.min_px(60) < 0.12


def test_one_view_holds_the_frame_and_stays(wrong):
    loaded, _, folder = wrong
    scene = look.Scene(loaded, loaded.views("train")[:1], loaded.folder / "images")
    job = align.Job(**dict(cases.job_of()), align=align.Align(**plane.ALIGN))
    found = aligner.Aligner(job, scene, folder, plane.METHOD)
    found.begin(10, "this")
    found.align({}, 2)
    np.testing.assert_array_equal(found.now.camtoworlds, loaded.camtoworlds)
    assert found.report[0]["cameras_moved"] == 0
    (reason,) = found.report[0]["left_alone"]
    assert "of one view" in reason


def test_cameras_that_move_later_let_older_offsets_go(wrong):
    loaded, _, folder = wrong
    found = plane.aligner_of(loaded, folder, cameras_at=[0.6], photos_at=[0.2])
    found.begin(10, "this")
    found.align({}, 2)
    assert found.offsets_px is not None
    found.align({}, 6)
    assert found.report[-1]["cameras_moved"]
    assert found.offsets_px is None


def test_where_photos_do_not_count_nothing_is_matched(wrong):
    """A masked part of a photo shows something else: no camera follows it."""
    loaded, true, folder = wrong
    (loaded.folder / "images/masks").mkdir()
    for view, name in enumerate(loaded.names):
        counts = np.ones((plane.HEIGHT, plane.WIDTH), bool)
        counts[:, 100:] = False
        np.savez(loaded.folder / f"images/masks/{name}.npz", valid=counts)
        photo = images.read(loaded.folder / f"images/{name}.png").copy()
        photo[:, 100:] = np.roll(photo[:, 100:], 9 + view, axis=0)
        images.write(loaded.folder / f"images/{name}.png", photo)
    found = plane.aligner_of(loaded, folder)
    before = plane.error_px(loaded, true)
    for step in found.places:
        found.align({}, step)
    assert plane.error_px(found.now, true) < 0.35 * before
    new = found.views(plane.views_of(loaded))
    counted = np.unpackbits(new.valid, axis=-1, count=plane.WIDTH).astype(bool)
    assert not counted[:, :, 104:].any()


def test_what_was_found_is_taken_again_to_the_bit(wrong):
    loaded, _, folder = wrong
    whole = plane.aligner_of(loaded, folder)
    for step in list(whole.places):
        whole.align({}, step)
    again = plane.aligner_of(loaded, folder)
    assert again.restore(9)
    assert again.report == whole.report
    given = plane.views_of(loaded)
    for old, new in zip(whole.views(given), again.views(given), strict=True):
        np.testing.assert_array_equal(old, new)


@pytest.mark.parametrize(("aligned", "step", "usable", "left"), [
    ([], 1, True, [2, 4]),
    ([], 3, False, [2, 4]),
    ([2], 1, True, [2, 4]),
    ([2], 2, True, [4]),
    ([2], 3, True, [2, 4]),
    ([2], 4, True, [2, 4]),
    ([2], 5, False, [2, 4]),
    ([2, 4], 4, True, [2]),
    ([2, 4], 3, False, [2, 4]),
])  # fmt: skip
def test_a_state_goes_on_with_its_own_alignments_only(
    wrong, aligned, step, usable, left
):
    """And the one before its very step is not made a second time."""
    loaded, _, folder = wrong
    first = plane.aligner_of(loaded, folder)
    for at in aligned:
        first.align({}, at)
    again = plane.aligner_of(loaded, folder)
    assert again.restore(step) == usable
    assert sorted(again.places) == left


def test_photos_too_small_for_a_flow_are_said_so():
    with pytest.raises(ValueError, match=r"60x40 pixels .* 48 px a side"):
        look.factor((40, 60), 48, 3)
    assert [look.factor((h, 500), 48, 3) for h in (48, 95, 96, 144, 4800)] == [
        *(1, 1, 2, 3, 3)
    ]
