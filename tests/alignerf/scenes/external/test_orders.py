"""Renders by numbers, by half of a sheet, and by names that were written loosely."""

import cv2
import numpy as np
import pytest

from alignerf.scenes.external import orders, renders
from tests.judged_cases import picture, write_png

SIZE = (40, 32)
NAMES = [f"IMG_{i}" for i in range(1, 13)]


def shot(i):
    return picture(100 + i, SIZE)


def soft(i):
    """A render of it."""
    return cv2.GaussianBlur(shot(i), (0, 0), 1.2)


def photos(folder, names, suffix=".png"):
    """{view: path} of a photo each, in this order."""
    for i, name in enumerate(names):
        write_png(folder / f"{name}{suffix}", shot(i))
    return {name.replace("/", "_"): folder / f"{name}{suffix}" for name in names}


def written(folder, names, shows, of=soft):
    """Renders of these names, each of the photo of a number."""
    for name, i in zip(names, shows, strict=True):
        write_png(folder / f"{name}.png", of(i))
    return folder


def right(found, taken):
    """Whether each render shows its photo."""
    return all(
        orders.alike(taken[view], one.path, one.part) > 0.9
        for view, one in found.renders.items()
    )


ORDERS = {
    "their names": sorted(NAMES),
    "the numbers in their names": NAMES,
    "the cameras' file": NAMES[6:] + NAMES[:6],
}


@pytest.mark.parametrize("how", ORDERS)
@pytest.mark.parametrize("layout", ["{:05}", "train/ours_7/renders/{:05}"])
def test_numbers_are_taken_in_the_order_that_fits_the_pictures(tmp_path, how, layout):
    taken = photos(tmp_path / "photos", NAMES)
    taken = {name: taken[name] for name in ORDERS["the cameras' file"]}
    numbers = [layout.format(i) for i in range(len(NAMES))]
    shows = [NAMES.index(name) for name in ORDERS[how]]
    found = renders.find(written(tmp_path / "renders", numbers, shows), taken)
    assert right(found, taken)
    assert found.layout.endswith(f"in the order of {how}")
    assert found.order == ORDERS[how]


def test_full_names_and_names_without_suffixes_sort_otherwise(tmp_path):
    """As 3D Gaussian splatting does since 2024, and did before."""
    names = ["a", "a-1", "b", "b-1"]
    taken = photos(tmp_path / "photos", names)
    for kind, shows in (("new", [1, 0, 3, 2]), ("old", [0, 1, 2, 3])):
        folder = tmp_path / kind / "train" / "ours_7" / "renders"
        written(folder, [f"{i:05}" for i in range(4)], shows)
        found = renders.find(tmp_path / kind, taken)
        assert right(found, taken)
        assert found.layout.endswith("names" if kind == "new" else "without suffixes")


def test_where_no_order_fits_the_usual_one_is_left(tmp_path):
    """What is wrong with the renders is then told of the pairs."""
    taken = photos(tmp_path / "photos", NAMES)
    shows = [5, 3, 9, 1, 11, 0, 7, 2, 10, 4, 8, 6]
    numbers = [f"{i:05}" for i in range(12)]
    found = renders.find(written(tmp_path / "renders", numbers, shows), taken)
    assert found.order == sorted(NAMES)


@pytest.mark.parametrize("gone", [0, 4, 11])
def test_one_photo_or_render_more_is_left_out_wherever_it_is(tmp_path, gone):
    names = [f"{i:04}" for i in range(1, 13)]
    taken = photos(tmp_path / "photos", names)
    shows = [i for i in range(12) if i != gone]
    numbers = [f"{i:05}" for i in range(11)]
    fewer = written(tmp_path / "fewer", numbers, shows)
    found = renders.find(fewer, taken)
    assert right(found, taken)
    assert {*taken} - {*found.renders} == {names[gone]}
    more = written(tmp_path / "more", [f"{i:05}" for i in range(12)], range(12))
    few = {name: path for name, path in taken.items() if name != names[gone]}
    found = renders.find(more, few)
    assert right(found, few)
    assert [path.stem for path in found.left_out] == [f"{gone:05}"]


def test_numbers_from_0_on_are_not_those_of_photos_from_1_on(tmp_path):
    """Most are called like a photo, and show the next."""
    taken = photos(tmp_path / "photos", [f"{i:04}" for i in range(1, 13)])
    folder = written(tmp_path / "renders", [f"{i:04}" for i in range(12)], range(12))
    found = renders.find(folder, taken)
    assert len(found.renders) == 12
    assert right(found, taken)


@pytest.mark.parametrize("numbers", [range(1, 13), (2, 3, 5, 7), (12,)])
@pytest.mark.parametrize("name", ["{:05}", "r_{}_rgb", "IMG_{:03}"])
def test_renders_may_have_the_numbers_of_their_photos(tmp_path, numbers, name):
    taken = photos(tmp_path / "photos", NAMES)
    written(tmp_path / "r", map(name.format, numbers), [n - 1 for n in numbers])
    found = renders.find(tmp_path / "r", taken)
    assert {*found.renders} == {f"IMG_{number}" for number in numbers}
    assert right(found, taken)


def test_renders_of_another_place_are_not_counted_out(tmp_path):
    taken = photos(tmp_path / "photos", NAMES)
    folder = written(tmp_path / "renders", range(11), range(40, 51))
    with pytest.raises(ValueError, match="are not as many"):
        renders.find(folder, taken)


@pytest.mark.parametrize(
    ("part", "join"),
    [
        ("right", lambda photo, render: np.hstack([photo, render])),
        ("left", lambda photo, render: np.hstack([render, photo])),
        ("bottom", lambda photo, render: np.vstack([photo, render])),
        ("top", lambda photo, render: np.vstack([render, photo])),
    ],
)
@pytest.mark.parametrize("names", [NAMES, [f"eval_9/{i:04}" for i in range(12)]])
def test_of_a_sheet_the_half_that_is_not_the_photo_is_the_render(
    tmp_path, part, join, names
):
    taken = photos(tmp_path / "photos", NAMES)
    folder = written(
        tmp_path / "renders", names, range(12), lambda i: join(shot(i), soft(i))
    )
    found = renders.find(folder, taken)
    assert right(found, taken)
    of_views = orders.which_half(found.renders, taken)
    assert {one.part for one in of_views.values()} == {part}
    assert {orders.size_of(one) for one in of_views.values()} == {SIZE}


def test_depths_normals_and_photos_among_renders_are_none(tmp_path):
    taken = photos(tmp_path / "photos", NAMES)
    for kind in ("", "_depth", "_normal", "_gt", "-alpha", ".mask"):
        numbers = [f"{i:05}{kind}" for i in range(12)]
        written(tmp_path / "renders", numbers, range(12), soft if not kind else shot)
    found = renders.find(tmp_path / "renders", taken)
    assert {one.path.stem for one in found.renders.values()} == {
        f"{i:05}" for i in range(12)
    }
    alone = {"depth_1": taken["IMG_1"]}
    written(tmp_path / "other", ["depth_1"], [0])
    assert [*renders.find(tmp_path / "other", alone).renders] == ["depth_1"]


@pytest.mark.parametrize(
    ("name", "render"),
    [
        ("cam0/1", "cam0/1"),
        ("cam0/1", "test/rgb/cam0/1"),
        ("cam0/1", "cam0_1"),
        ("cam0/1", "cam0-1.jpg"),
        ("cam0/1", "render_cam0_1"),
        ("IMG 1 (2)", "IMG%201%20(2)"),
        ("IMG 1 (2)", "img_1_2"),
        ("IMG 1 (2)", "IMG 1 (2)_rgb"),
        ("IMG_1", "IMG_1 (1)"),
        ("IMG_1", "img_1 - Copy (2)"),
        ("Ä", "a\u0308"),
    ],
)
def test_a_render_is_called_like_its_photo_loosely(tmp_path, name, render):
    names = [name, "cam1/1", "other"]
    taken = photos(tmp_path / "photos", names)
    found = renders.find(
        written(tmp_path / "renders", [render, "other"], [0, 2]), taken
    )
    assert {*found.renders} == {name.replace("/", "_"), "other"}
    assert right(found, taken)


def test_a_name_that_two_photos_fit_is_of_neither(tmp_path):
    taken = photos(tmp_path / "photos", ["cam0/1", "cam1/1", "a b", "a_b"])
    called = renders.Called(taken)
    assert called.view_of(tmp_path / "1.png") == (None, 0)
    assert called.view_of(tmp_path / "A-B.png") == (None, 0)
    assert called.view_of(tmp_path / "a b.png") == ("a b", 0)


def test_a_copy_does_not_come_before_the_file(tmp_path):
    taken = photos(tmp_path / "photos", ["IMG_1", "IMG_2"])
    folder = written(tmp_path / "r", ["IMG_1 (1)", "IMG_1", "IMG_2"], [0, 0, 1])
    found = renders.find(folder, taken)
    assert found.renders["IMG_1"].path.stem == "IMG_1"
    assert [path.stem for path in found.left_out] == ["IMG_1 (1)"]


def test_folders_of_cameras_are_no_steps_though_they_have_numbers(tmp_path):
    names = [f"DJI_0{n}/{i:06}" for n in (238, 286) for i in range(2)]
    taken = photos(tmp_path / "photos", names)
    found = renders.find(written(tmp_path / "renders", names, range(4)), taken)
    assert len(found.renders) == 4
    assert right(found, taken)


@pytest.mark.parametrize("place", ["out", "train/renders"])
def test_numbers_of_what_was_learnt_are_no_names_of_numbered_photos(tmp_path, place):
    """Of photos 00000 to 00023 the renders 00000 to 00020 leave out every eighth."""
    names = [f"{i:05}" for i in range(24)]
    taken = photos(tmp_path / "photos", names)
    shows = [i for i in range(24) if i % 8]
    found = renders.find(written(tmp_path / place, names[:21], shows), taken)
    assert right(found, taken)
    assert {one.split for one in found.renders.values()} == {"train"}
