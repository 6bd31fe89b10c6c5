"""Crops of photos around a point: cameras, pixels, and which point is taken."""

import tracemalloc

import numpy as np
import pytest

from alignerf.colmap import crops
from alignerf.scenes import cameras, prepare

WIDTH, HEIGHT, PX = 200, 150, 64


def image_of(view):
    """A photo whose pixels say where they are: x, y and the view."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    return np.stack([x, y, np.full_like(x, view)], axis=-1).astype(np.uint8)


@pytest.fixture
def views(rng):
    """Six cameras in a row that look along -z, two units before a wall of points."""
    count = 6
    poses = np.tile(np.eye(3, 4), (count, 1, 1))
    poses[:, 0, 3] = np.linspace(-0.3, 0.3, count)
    points = np.concatenate([rng.uniform(-1, 1, (400, 2)), np.full((400, 1), -2)], 1)
    return prepare.PosedViews(
        names=[f"view_{i}" for i in range(count)],
        pixtocams=np.tile(cameras.intrinsics(150.0, WIDTH, HEIGHT), (count, 1, 1)),
        camtoworlds=poses,
        width=WIDTH,
        height=HEIGHT,
        photos=[prepare.Photo(view, (image_of,)) for view in range(count)],
        points=(points, np.zeros((400, 3), np.uint8)),
    )


def around(point, views, px, *, least):
    """The crops as views."""
    return crops.cut(views, crops.around(point, views, px, least=least))


def test_a_crop_sees_what_its_photo_sees_there(views):
    point = np.array([0.05, -0.1, -2.0])
    cut = around(point, views, PX, least=4)
    assert (cut.width, cut.height, len(cut.names)) == (PX, PX, 6)
    for place, name in enumerate(cut.names):
        whole = views.names.index(name)
        image = cut.photos[place].read()
        assert image.shape == (PX, PX, 3)
        assert set(image[..., 2].ravel()) == {whole}
        corner = image[0, 0, :2].astype(int)
        of_whole = (views.pixtocams[whole], views.camtoworlds[whole])
        of_crop = (cut.pixtocams[place], cut.camtoworlds[place])
        (xy, depth), (own, same) = (
            cameras.project(views.points[0], *camera) for camera in (of_whole, of_crop)
        )
        np.testing.assert_allclose(own + corner, xy, atol=1e-9)
        np.testing.assert_allclose(same, depth)
        # The point lies in the middle, to half a pixel.
        middle, _ = cameras.project(point, *of_crop)
        assert np.abs(middle - PX / 2).max() <= 0.5 + 1e-9
    # Points that two crops see, and no others.
    assert 0 < len(cut.points[0]) < len(views.points[0])


def test_views_without_the_whole_crop_are_left_out(views):
    # The cameras to the left do not see so far to the right.
    point = np.array([0.75, 0.0, -2.0])
    cut = around(point, views, PX, least=1)
    assert 0 < len(cut.names) < 6
    assert cut.names == views.names[-len(cut.names) :]
    with pytest.raises(ValueError, match=r"64 px around .* lies in \d photos, under 6"):
        around(point, views, PX, least=6)


def test_a_point_behind_the_cameras_is_in_no_crop(views):
    with pytest.raises(ValueError, match="lies in 0 photos"):
        around([0.0, 0.0, 2.0], views, PX, least=1)
    with pytest.raises(ValueError, match="lies in 0 photos"):
        around([0.0, 0.0, 0.0], views, PX, least=1)


def test_chosen_points_are_in_all_photos_and_apart(views):
    chosen = crops.choose(views.points[0], views, PX, 3, least=4)
    assert len(chosen) > 1
    for point in chosen:
        around(point, views, PX, least=6)
    first, second = chosen[:2]
    for camera in zip(views.pixtocams, views.camtoworlds, strict=True):
        away = cameras.project(first, *camera)[0] - cameras.project(second, *camera)[0]
        assert np.abs(away).max() >= PX - 1e-9
    again = crops.choose(views.points[0], views, PX, 3, least=4)
    np.testing.assert_array_equal(again, chosen)


def test_texture_and_the_middle_of_the_depths_are_preferred(views):
    wall, _ = views.points
    dense = np.array([0.1, 0.1, -2.0]) + 0.02 * np.random.default_rng(1).normal(
        size=(200, 3)
    ) * [1, 1, 0]
    far = np.array([[0.0, 0.0, -200.0]])
    points = np.concatenate([wall, dense, far])
    (best,) = crops.choose(points, views, PX, 1, least=4)
    assert np.linalg.norm(best - [0.1, 0.1, -2.0]) < 0.5
    assert not np.array_equal(best, far[0])


def test_texture_is_counted_as_by_all_pairs(rng):
    xy, depth = rng.uniform(-50, 450, (3, 300, 2)), rng.normal(1, 1, (3, 300))
    depth[:, :9] = 1.0
    inside = (depth > 0) & (rng.random((3, 300)) < 0.9)
    inside[0, :9] = True
    xy[:, 1] = xy[:, 0] + [PX / 2, 0]  # just outside its crop
    found = crops.neighbours(crops.Seen(xy, depth, inside), np.arange(9), PX)
    assert found.max() > 5
    for candidate, count in enumerate(found):
        away = np.abs(xy - xy[:, candidate, None]).max(axis=-1)
        each = ((away < PX / 2) & (depth > 0)).sum(axis=1)[inside[:, candidate]]
        assert count == np.median(each)


def test_hundreds_of_thousands_of_points_take_no_gigabytes(views):
    """As 300 photos of 12 megapixels have: all pairs of points took 12 GB and hours."""
    wall, errors = views.points
    many = np.resize(wall, (200_000, 3)), np.resize(errors, 200_000)
    tracemalloc.start()
    chosen, px = crops.places(views._replace(points=many), PX, 2, least=4)
    _, max_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (len(chosen), px) == (2, PX)
    assert max_bytes < 2e8


def test_no_crop_is_said_with_the_best_there_is(views):
    with pytest.raises(ValueError, match=r"no crop of 149 px lies in 6 photos"):
        crops.choose(views.points[0], views, 149, 1, least=6)
    with pytest.raises(ValueError, match=r"the best in 0 of 6"):
        crops.choose(views.points[0], views, 190, 1, least=1)


def test_masks_and_splits_follow(views):
    split = np.array(["test", *["train"] * 5])
    masks = [prepare.all_count(WIDTH, HEIGHT)] * 6
    marked = views._replace(split=split, masks=masks)
    cut = around([0.0, 0.0, -2.0], marked, PX, least=4)
    assert cut.split.tolist() == split.tolist()
    assert all((mask.read() == 255).all() for mask in cut.masks)
    assert cut.masks[0].read().shape[:2] == (PX, PX)


def test_crops_that_their_masks_hide_are_left_out():
    """As of photos of another lens, which cover a part of the canvas."""
    masks = [np.full((100, 100, 3), 255, np.uint8) for _ in range(3)]
    masks[1][:, :45] = 0
    masks[2][:, :10] = 0
    photos = [prepare.Photo(mask, (np.asarray,)) for mask in masks]
    views = prepare.PosedViews(
        names=["a", "b", "c"],
        pixtocams=np.zeros((3, 3, 3)),
        camtoworlds=np.zeros((3, 3, 4)),
        width=100,
        height=100,
        photos=photos,
        masks=photos,
    )
    corners = np.array([[10, 10], [10, 10], [10, 10]])
    cut = crops.Crops(40, np.arange(3), corners)
    assert crops.that_count(views, cut).kept.tolist() == [0, 2]
    assert crops.that_count(views._replace(masks=None), cut) is cut


def test_a_photo_of_several_crops_is_decoded_once():
    decoded = []

    def decode(i):
        decoded.append(i)
        return np.full((8, 8, 3), i, np.uint8)

    photos = crops.read_once([prepare.Photo(i, (decode,)) for i in range(3)])
    cut = [photo.then(crops.piece_at((2, 3), 4)) for photo in photos]
    for i in (0, 0, 1, 1, 2, 2):
        np.testing.assert_array_equal(cut[i].read(), np.full((4, 4, 3), i))
    assert decoded == [0, 1, 2]
