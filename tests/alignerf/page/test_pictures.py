"""The page's images: which views, what colours, and how they come to fit."""

import base64
import io

import numpy as np
import pytest
from PIL import Image

from alignerf.page import pictures
from alignerf.verdict import views
from flow.figures import colour_wheel


def view(name, flow_px, split="test", why=""):
    numbers = dict.fromkeys(views.COLUMNS, 0.5)
    return views.View(
        **numbers
        | {"view": name, "split": split, "flow_px": flow_px, "stands_out": why}
    )


def shown(name, image, split="test"):
    return pictures.Shown(name, split, "", {"photo": image, "render": image})


def decoded(uri):
    head, data = uri.split(",")
    assert head == "data:image/webp;base64"
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))


def test_the_worst_views_come_first_and_training_views_only_where_they_stand_out():
    found = pictures.choose(
        [
            view("a", 0.1),
            view("b", 0.3),
            view("c", 9.0, "train"),
            view("d", 0.2, "train", "blurred"),
            view("e", np.nan),
        ]
    )
    assert [one.view for one in found] == ["e", "b", "d", "a"]


def test_of_many_views_those_that_stand_out_and_evenly_spaced_others_are_shown():
    many = [view(f"{i:03}", 0.1) for i in range(200)]
    many[77] = view("077", 5.0, why="shifted")
    found = [one.view for one in pictures.choose(many)]
    assert len(found) == len(set(found)) == pictures.MOST_TEST
    assert found[0] == "077"
    assert {"000", "199"} <= set(found)


def test_an_aligned_scene_looks_aligned_and_a_bad_one_bad_whatever_its_own_scale():
    still = pictures.coloured(np.full((4, 4, 2), 0.05), limit_px=0.25)
    assert still.min() >= 253
    far = pictures.coloured(np.full((4, 4, 2), 3.0), limit_px=0.25)
    assert far.min() < 20
    # The same flow has the same colour beside any other.
    beside = np.full((4, 4, 2), 3.0)
    beside[0] = 40.0
    np.testing.assert_array_equal(pictures.coloured(beside, limit_px=0.25)[1:], far[1:])


def test_colours_fade_without_an_edge_and_only_beneath_the_least():
    length = np.linspace(0, 2, 201)
    flow_px = np.stack([length, 0 * length], axis=-1)[None]
    faded = np.linalg.norm(colour_wheel.faded(flow_px, 1.0), axis=-1)[0]
    assert (np.diff(faded) > 0).all()
    np.testing.assert_allclose(faded[100:], length[100:])
    assert faded[50] == pytest.approx(0.125)


@pytest.mark.parametrize("least_px", [np.nan, np.inf, -1.0])
def test_a_least_that_is_no_length_is_refused(least_px):
    with pytest.raises(ValueError, match="least_px"):
        colour_wheel.faded(np.zeros((1, 1, 2)), least_px)


def test_a_least_of_0_changes_nothing_and_unknown_flow_stays_unknown():
    flow_px = np.array([[[0.0, 0.0], [1.0, 0.0], [np.nan, 0.0], [1e300, 1e300]]])
    with np.errstate(over="ignore"):
        found = colour_wheel.faded(flow_px, 0.0)
        colours = pictures.coloured(flow_px, limit_px=1.0)
    np.testing.assert_array_equal(found, flow_px)
    # Not known is black.
    np.testing.assert_array_equal(colours[0, 2], [0, 0, 0])


def test_images_keep_their_size_where_they_fit(rng):
    image = rng.integers(0, 256, (40, 60, 3), dtype=np.uint8)
    uris = pictures.fitted([shown("a", image)])["test/a"]
    assert list(uris) == ["photo", "render"]
    assert decoded(uris["photo"]).shape == image.shape


def test_too_many_pixels_are_made_smaller_until_they_fit(rng, monkeypatch):
    image = rng.integers(0, 256, (400, 600, 3), dtype=np.uint8)
    monkeypatch.setattr(pictures, "MOST_BYTES", 60_000)
    uris = pictures.fitted([shown("a", image)])["test/a"]
    assert max(decoded(uris["photo"]).shape) < 600
    assert sum(map(len, uris.values())) * 3 // 4 <= 60_000


def test_what_does_not_fit_at_the_smallest_size_is_left_out_from_the_end(
    rng, monkeypatch
):
    image = rng.integers(0, 256, (280, 280, 3), dtype=np.uint8)
    many = [shown(f"{i}", image) for i in range(9)]
    monkeypatch.setattr(pictures, "MOST_BYTES", 150_000)
    found = list(pictures.fitted(many))
    assert 0 < len(found) < 9
    assert found == [f"test/{i}" for i in range(len(found))]


def test_a_wheel_is_white_in_its_middle_and_outside():
    found = pictures.wheel(1.0)
    middle = pictures.WHEEL_PX // 2
    assert found[middle, middle].min() > 250
    assert (found[0, 0] == 255).all()
    assert found[middle, 2].min() < 60


def test_a_flow_turns_with_its_image():
    """Seen upright, a point moves from where it was seen to where it was seen."""
    flow_px = np.zeros((4, 6, 2))
    flow_px[1, 2] = (3.0, 1.0)  # from (2, 1) to (5, 2)
    marks = np.zeros((4, 6))
    marks[1, 2], marks[2, 5] = 1, 2
    for turns in range(4):
        found, seen = pictures.turned(flow_px, turns), np.rot90(marks, -turns)
        ((y, x),) = np.argwhere(seen == 1)
        ((y_to, x_to),) = np.argwhere(seen == 2)
        np.testing.assert_array_equal(found[y, x], [x_to - x, y_to - y])
