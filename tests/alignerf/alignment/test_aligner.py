"""Alignment on the way: cameras and photos of a scene that is known exactly.

A plane with a smooth texture, rendered by a method that has nothing to learn: what the
aligner finds is the cameras' error, and the motion of a thing in one photo.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf.alignment import aligner, look, looker, photos, store
from alignerf.experiment.keys import method as method_keys
from alignerf.files import images
from alignerf.mipnerf360 import model
from alignerf.scenes import cameras, prepared
from alignerf.training import batches, methods, renderer
from flow.camera import correct
from flow.camera import motion as camera_motion
from tests import training_cases as cases

WIDTH, HEIGHT, FOCAL_PX, COUNT = 180, 144, 150.0, 8
ALIGN = {"cameras_at": [0.2, 0.4], "photos_at": [0.4], "shrink": 3}


def texture(place):
    """Colours of places [n, 2] on the plane; no two parts of it look alike."""
    x, y = place[:, 0], place[:, 1]
    waves = [
        jnp.sin(7.0 * x + 3.1 * jnp.sin(2.3 * y)),
        jnp.sin(9.0 * y + 2.7 * jnp.sin(3.1 * x)),
        jnp.sin(5.0 * (x + y) + jnp.sin(4.3 * (x - y))),
    ]
    return 0.5 + 0.3 * jnp.stack(waves, axis=-1)


def render(params, rays):
    """The plane z = -2, which leans a little towards y."""
    normal = jnp.array([0.0, 0.3, 1.0])
    t = -(2.0 + rays.origins @ normal) / (rays.directions @ normal)
    places = rays.origins + t[:, None] * rays.directions
    return model.Rendering(texture(places[:, :2]), t, ())


METHOD = methods.Method(1, None, None, None, render, lambda params, values: values)


def poses_of(rng):
    poses = np.repeat(np.eye(4)[None, :3], COUNT, axis=0)
    poses[:, :, 3] = rng.uniform(-1, 1, size=(COUNT, 3)) * [1, 1, 0.2]
    return poses


def turned(poses, rng, px):
    found = poses.copy()
    for pose in found[1:]:
        turn = Rotation.from_rotvec(rng.normal(size=3) * [1, 1, 0.3] * px / FOCAL_PX)
        pose[:, :3] = pose[:, :3] @ turn.as_matrix()
    return found


def make_scene(folder, true, given, photo_of=lambda i, photo: photo):
    """A prepared scene whose photos were taken by other cameras than are given."""
    pixtocam = cameras.intrinsics(FOCAL_PX, WIDTH, HEIGHT)
    (folder / "images").mkdir(parents=True)
    np.savez(
        folder / "cameras.npz",
        pixtocams=np.stack([pixtocam] * COUNT),
        camtoworlds=given,
        names=[f"v{i}" for i in range(COUNT)],
        width=WIDTH,
        height=HEIGHT,
        split=["test", *["train"] * (COUNT - 1)],
    )
    loaded = prepared.load(folder)
    # The truth in the frame that the given cameras are normalised to.
    seen = cameras.frame_of(given).normalised(true)
    paint = renderer.make_renderer(METHOD, {}, WIDTH, HEIGHT)
    for i in range(COUNT):
        photo = photo_of(i, paint(pixtocam, seen[i])[0])
        images.write(folder / f"images/v{i}.png", photo)
    return loaded, seen


def aligner_of(loaded, folder, **changes):
    scene = looker.Scene(loaded, loaded.views("train"), loaded.folder / "images")
    job = cases.job_of()
    job = job.model_copy(update={"align": method_keys.Align(**ALIGN | changes)})
    found = aligner.Aligner(job, scene, folder, METHOD)
    found.begin(10, "this")
    return found


def error_px(state, true):
    """Mean distance of where the state's and the true cameras see the plane."""
    train = state.views("train")
    gauge = cameras.align_similarity(true[train], state.camtoworlds[train])
    true = cameras.apply_similarity(true, *gauge)
    errors = []
    for i in train:
        place = np.array([[0.2, -0.1, -2.0], [-0.4, 0.3, -2.0]])
        ends = [
            cameras.project(place, state.pixtocams[i], p[i])[0]
            for p in (true, state.camtoworlds)
        ]
        errors.append(np.linalg.norm(ends[0] - ends[1], axis=-1))
    return float(np.mean(errors))


@pytest.fixture
def wrong(tmp_path, rng):
    true = poses_of(rng)
    loaded, seen = make_scene(tmp_path / "scene", true, turned(true, rng, 3.0))
    return loaded, seen, tmp_path / "checkpoints"


def views_of(loaded):
    chosen = loaded.views("train")
    return batches.load_views(loaded, chosen, loaded.folder / "images")


def test_wrong_cameras_come_to_the_truth_and_the_frame_stays(wrong):
    loaded, true, folder = wrong
    found = aligner_of(loaded, folder)
    before = error_px(loaded, true)
    assert before > 1.5
    for step in found.places:
        found.align({}, step)
    assert error_px(found.now, true) < 0.15 * before
    test = loaded.views("test")
    np.testing.assert_array_equal(found.now.camtoworlds[test], loaded.camtoworlds[test])
    train = loaded.views("train")
    scale, turn, shift = cameras.align_similarity(
        found.now.camtoworlds[train], loaded.camtoworlds[train]
    )
    assert scale == pytest.approx(1, abs=1e-3)
    np.testing.assert_allclose(turn, np.eye(3), atol=1e-3)
    np.testing.assert_allclose(shift, 0, atol=1e-3)
    first, second = found.report
    assert first["cameras_moved"] == COUNT - 1
    assert first["flow_px"] > 1.5 > second["flow_px"]
    assert second["corrects"] == ["cameras", "photos"]


def test_where_nothing_is_wrong_nothing_changes_at_all(tmp_path, rng):
    poses = poses_of(rng)
    loaded, _ = make_scene(tmp_path / "scene", poses, poses)
    found = aligner_of(loaded, tmp_path / "checkpoints")
    for step in found.places:
        found.align({}, step)
    np.testing.assert_array_equal(found.now.camtoworlds, loaded.camtoworlds)
    given = views_of(loaded)
    for old, new in zip(given, found.views(given), strict=True):
        np.testing.assert_array_equal(old, new)
    assert [row["cameras_moved"] for row in found.report] == [0, 0]
    (reason,) = found.report[0]["left_alone"]
    assert "that is the flow's error" in reason


@pytest.fixture
def looked_at(monkeypatch):
    """Indices of the views of each look; two of seven views may tell."""
    monkeypatch.setattr(aligner, "LEAST_PROBED", 2)
    every, look_at = [], looker.Looker.__call__

    def counted(self, params, now, wanted):
        every.append(list(wanted))
        return look_at(self, params, now, wanted)

    monkeypatch.setattr(looker.Looker, "__call__", counted)
    return every


def test_where_some_views_show_nothing_wrong_only_the_last_look_is_at_all(
    tmp_path, rng, looked_at
):
    poses = poses_of(rng)
    # One camera is wrong, and not among those that are looked at first.
    given = poses.copy()
    given[4] = turned(poses[3:5], rng, 6.0)[1]
    loaded, _ = make_scene(tmp_path / "scene", poses, given)
    found = aligner_of(loaded, tmp_path / "checkpoints")
    for step in found.places:
        found.align({}, step)
    assert looked_at == [[0, 6], list(range(COUNT - 1))]
    assert [row["views"] for row in found.report] == [2, COUNT - 1]
    assert [row["cameras_moved"] for row in found.report] == [0, 1]


def test_the_last_look_for_cameras_is_at_all_though_photos_come_later(
    tmp_path, rng, looked_at
):
    poses = poses_of(rng)
    loaded, _ = make_scene(tmp_path / "scene", poses, poses)
    places = {"cameras_at": [0.2, 0.4], "photos_at": [0.6]}
    found = aligner_of(loaded, tmp_path / "checkpoints", **places)
    for step in found.places:
        found.align({}, step)
    assert [len(wanted) for wanted in looked_at] == [2, COUNT - 1, COUNT - 1]


def test_where_some_views_show_a_fault_it_is_as_if_all_were_looked_at(
    wrong, looked_at, monkeypatch
):
    loaded, _, folder = wrong
    found = aligner_of(loaded, folder)
    for step in found.places:
        found.align({}, step)
    assert looked_at == [[0, 6], [1, 2, 3, 4, 5], list(range(COUNT - 1))]
    monkeypatch.setattr(aligner, "LEAST_PROBED", COUNT)
    whole = aligner_of(loaded, folder)
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

    poses = poses_of(rng)
    loaded, _ = make_scene(tmp_path / "scene", poses, poses, photo_of)
    found = aligner_of(loaded, tmp_path / "checkpoints")
    for step in found.places:
        found.align({}, step)
    given = views_of(loaded)
    new = found.views(given)
    slot = 2  # of view 3 among the training views
    others = [i for i in range(COUNT - 1) if i != slot]
    np.testing.assert_array_equal(new.photos[others], given.photos[others])
    truth = renderer.make_renderer(METHOD, {}, WIDTH, HEIGHT)(
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
    found = aligner_of(loaded, folder, least_move_px=0.12)
    found.begin(100, "this")
    assert [round(found.least_px(step), 3) for step in (5, 10, 25, 60)] == [
        *(0.6, 0.3, 0.12, 0.12)
    ]
    found.report = [{"cameras_moved": 0}]
    assert found.least_px(50) == 0.12
    # One bad camera among good ones says nothing of the others.
    found.report = [{"cameras_moved": 1}]
    assert found.least_px(50) == 0.12
    found.report = [{"cameras_moved": COUNT - 1}]
    assert found.least_px(10) == found.least_px(60) < 0.12


def flow_view(motion, depth=None):
    """What a small view says of a camera that moved like this, and of nothing else."""
    depth = np.full((48, 60), 2.0) if depth is None else depth
    pixtocam = cameras.intrinsics(50.0, 60, 48)
    points = camera_motion.points_of(pixtocam, depth)
    flow_px = camera_motion.flow(motion, points).astype(np.float32)
    return correct.View(flow_px, np.ones(depth.shape, bool), pixtocam, depth)


def correction(motion, **changes):
    found = correct.Correction(motion, 1.0, 0.02, 1.0, 2.0, "")
    return found._replace(**changes)


TURN = camera_motion.Motion(np.array([0.01, 0.02, 0.0]), np.zeros(3), 0.01)


@pytest.mark.parametrize("whole", [True, False])
def test_what_the_camera_has_put_right_is_not_warped_too(whole):
    view = flow_view(TURN)
    options = {"whole": whole, "most_pixels": 1000}
    offset, valid = photos.offsets(view, correction(TURN), **options)
    assert np.abs(offset).max() < 0.02
    assert valid.all()
    # Without a camera that moves the whole flow is the photo's.
    alone, _ = photos.offsets(view, None, **options)
    assert (np.abs(alone).max() > 0.9) == whole


def test_a_flow_that_no_camera_explains_warps_no_photo(rng):
    view = flow_view(TURN)._replace(
        flow_px=rng.normal(size=(48, 60, 2)).astype(np.float32) * 5
    )
    refused = correct.corrections([lambda: view, *[lambda: flow_view(TURN)] * 4])
    assert not refused[0].trusted
    assert all(one.trusted for one in refused[1:])
    offset, _ = photos.offsets(view, refused[0], whole=False, most_pixels=1000)
    assert not offset.any()


@pytest.mark.parametrize("fill", [np.nan, np.inf, 0.0])
def test_depths_that_are_none_are_no_part_of_a_fit(fill):
    """Far away is a depth; none is not. All stays finite."""
    depth = np.full((48, 60), 2.0)
    depth[:20] = fill
    view = flow_view(TURN, depth=np.full((48, 60), 2.0))._replace(depth=depth)
    (found,) = correct.corrections([lambda: view], zooms=False)
    assert np.isfinite(found.length_px)
    offset, _ = photos.offsets(view, found, whole=False, most_pixels=1000)
    assert np.isfinite(offset).all()


def test_one_view_holds_the_frame_and_stays(wrong):
    loaded, _, folder = wrong
    scene = looker.Scene(loaded, loaded.views("train")[:1], loaded.folder / "images")
    job = cases.job_of().model_copy(update={"align": method_keys.Align(**ALIGN)})
    found = aligner.Aligner(job, scene, folder, METHOD)
    found.begin(10, "this")
    found.align({}, 2)
    np.testing.assert_array_equal(found.now.camtoworlds, loaded.camtoworlds)
    assert found.report[0]["cameras_moved"] == 0
    (reason,) = found.report[0]["left_alone"]
    assert "of one view" in reason


def test_cameras_that_move_later_let_older_offsets_go(wrong):
    loaded, _, folder = wrong
    found = aligner_of(loaded, folder, cameras_at=[0.6], photos_at=[0.2])
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
        counts = np.ones((HEIGHT, WIDTH), bool)
        counts[:, 100:] = False
        np.savez(loaded.folder / f"images/masks/{name}.npz", valid=counts)
        photo = images.read(loaded.folder / f"images/{name}.png").copy()
        photo[:, 100:] = np.roll(photo[:, 100:], 9 + view, axis=0)
        images.write(loaded.folder / f"images/{name}.png", photo)
    found = aligner_of(loaded, folder)
    before = error_px(loaded, true)
    for step in found.places:
        found.align({}, step)
    assert error_px(found.now, true) < 0.35 * before
    new = found.views(views_of(loaded))
    counted = np.unpackbits(new.valid, axis=-1, count=WIDTH).astype(bool)
    assert not counted[:, :, 104:].any()


def test_what_was_found_is_taken_again_to_the_bit(wrong):
    loaded, _, folder = wrong
    whole = aligner_of(loaded, folder)
    for step in list(whole.places):
        whole.align({}, step)
    again = aligner_of(loaded, folder)
    assert again.restore(9)
    assert again.report == whole.report
    given = views_of(loaded)
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
    first = aligner_of(loaded, folder)
    for at in aligned:
        first.align({}, at)
    again = aligner_of(loaded, folder)
    assert again.restore(step) == usable
    assert sorted(again.places) == left


@pytest.mark.parametrize("way", ["cut", "altered", "manifest", "identity", "elsewhere"])
def test_damaged_alignments_count_as_none(wrong, way, caplog):
    loaded, _, folder = wrong
    aligner_of(loaded, folder).align({}, 2)
    (path,) = folder.glob("alignment-*.msgpack")
    manifest = folder / "alignment.json"
    if way == "cut":
        path.write_bytes(path.read_bytes()[:-9])
    elif way == "altered":
        data = bytearray(path.read_bytes())
        data[len(data) // 2] ^= 1
        path.write_bytes(bytes(data))
    elif way == "manifest":
        manifest.write_text("[]")
    elif way == "elsewhere":
        text = manifest.read_text().replace("alignment-2.msgpack", "../other.msgpack")
        manifest.write_text(text)
    other = aligner_of(loaded, folder)
    if way == "identity":
        other.begin(10, "another")
    assert not other.restore(3)
    assert ("alignment not usable" in caplog.text) == (way != "identity")


def test_arrays_of_another_shape_are_refused(wrong):
    loaded, _, folder = wrong
    size = aligner_of(loaded, folder).sizes()
    arrays = {name: np.zeros(shape, dtype) for name, (shape, dtype) in size.items()}
    store.check(arrays, size)
    with pytest.raises(ValueError, match="not this training's"):
        store.check({**arrays, "valid": arrays["valid"][:2]}, size)
    arrays["camtoworlds"][0, 0, 0] = np.nan
    with pytest.raises(ValueError, match="camtoworlds is not finite"):
        store.check(arrays, size)


def test_photos_too_small_for_a_flow_are_said_so():
    with pytest.raises(ValueError, match=r"60x40 pixels .* 48 px a side"):
        look.factor((40, 60), 48, 3)
    assert [look.factor((h, 500), 48, 3) for h in (48, 95, 96, 144, 4800)] == [
        *(1, 1, 2, 3, 3)
    ]
