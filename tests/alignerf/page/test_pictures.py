"""The page's images: which views, what colours, and how they come to fit."""

import base64
import io
import pathlib

import numpy as np
import pytest
from PIL import Image

from alignerf.page import gallery, pictures
from alignerf.verdict import views
from flow.figures import drawing


def view(name, flow_px, split="test", why=""):
    numbers = dict.fromkeys(views.COLUMNS, 0.5)
    return views.View(
        **numbers
        | {"view": name, "split": split, "flow_px": flow_px, "stands_out": why}
    )


def shown(name, image, more=()):
    read = {key: lambda: image for key in ("photo", "render", *more)}
    renders = {"render": "by base"}
    return gallery.Shown(view(name, 0.5), 0, read, renders, pathlib.Path("none.npz"))


def coloured(flow_px, limit_px=0.25):
    valid = np.ones(flow_px.shape[:2], bool)
    return gallery.coloured(flow_px, valid, limit_px)


def decoded(uri):
    head, data = uri.split(",")
    assert head == "data:image/webp;base64"
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))


def test_the_worst_photos_come_first_whatever_their_split():
    views = [view("a", 0.1), view("b", 0.3), view("c", 9.0, "train"), view("e", np.nan)]
    found = pictures.in_order(views)
    assert [one.view for one in found] == ["e", "c", "b", "a"]


def test_an_aligned_scene_looks_aligned_and_a_bad_one_bad_whatever_its_own_scale():
    still = coloured(np.full((4, 4, 2), 0.05))
    assert still.min() >= 253
    far = coloured(np.full((4, 4, 2), 3.0))
    assert far.min() < 20
    # The same flow has the same colour beside any other.
    beside = np.full((4, 4, 2), 3.0)
    beside[0] = 40.0
    np.testing.assert_array_equal(coloured(beside)[1:], far[1:])


def test_colours_fade_without_an_edge_and_only_beneath_the_least():
    length = np.linspace(0, 2, 201)
    flow_px = np.stack([length, 0 * length], axis=-1)[None]
    faded = np.linalg.norm(drawing.faded(flow_px, 1.0), axis=-1)[0]
    assert (np.diff(faded) > 0).all()
    np.testing.assert_allclose(faded[100:], length[100:])
    assert faded[50] == pytest.approx(0.125)


@pytest.mark.parametrize("min_px", [np.nan, np.inf, -1.0])
def test_a_min_that_is_no_length_is_refused(min_px):
    with pytest.raises(ValueError, match="min_px"):
        drawing.faded(np.zeros((1, 1, 2)), min_px)


def test_a_min_of_0_changes_nothing_and_unknown_flow_stays_unknown():
    flow_px = np.array([[[0.0, 0.0], [1.0, 0.0], [np.nan, 0.0], [1e300, 1e300]]])
    with np.errstate(over="ignore"):
        found = drawing.faded(flow_px, 0.0)
        colours = coloured(flow_px, limit_px=1.0)
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
    monkeypatch.setattr(pictures, "MAX_BYTES", 60_000)
    uris = pictures.fitted([shown("a", image)])["test/a"]
    assert max(decoded(uris["photo"]).shape) < 600
    assert sum(map(pictures.size_of, uris.values())) <= 60_000


def test_where_space_is_short_only_the_worst_have_every_layer(rng, monkeypatch):
    image = rng.integers(0, 256, (40, 60, 3), dtype=np.uint8)
    many = [shown(f"{i}", image, more=("flow", "truth")) for i in range(5)]
    many.append(shown("5", image, more=("flow", pictures.KEPT[1])))
    monkeypatch.setattr(pictures, "MAX_WHOLE", 2)
    whole = pictures.fitted(many)
    size = sum(pictures.size_of(uri) for one in whole.values() for uri in one.values())
    monkeypatch.setattr(pictures, "MAX_BYTES", 0.8 * size)
    found = pictures.fitted(many)
    assert [len(one) for one in found.values()] == [4, 4, 2, 2, 2, 3]
    assert pictures.KEPT[1] in found["test/5"]
    assert decoded(found["test/0"]["photo"]).shape == image.shape


def test_what_does_not_fit_at_the_smallest_size_is_left_out_from_the_end(
    rng, monkeypatch
):
    image = rng.integers(0, 256, (280, 280, 3), dtype=np.uint8)
    many = [shown(f"{i}", image) for i in range(9)]
    monkeypatch.setattr(pictures, "MAX_BYTES", 150_000)
    found = list(pictures.fitted(many))
    assert 0 < len(found) < 9
    assert found == [f"test/{i}" for i in range(len(found))]


def test_small_pictures_are_of_all_photos_and_fit(rng, monkeypatch):
    image = rng.integers(0, 256, (280, 280, 3), dtype=np.uint8)
    many = [shown(f"{i}", image) for i in range(4)]
    large = pictures.thumbs(many)
    assert max(decoded(large["test/0"]).shape) == pictures.THUMBS[0][0]
    monkeypatch.setattr(pictures, "MAX_THUMB_BYTES", 4_000)
    small = pictures.thumbs(many)
    assert list(small) == list(large)
    assert max(decoded(small["test/0"]).shape) < pictures.THUMBS[0][0]


def test_a_wheel_is_white_in_its_middle_and_outside():
    found = gallery.wheel(1.0)
    middle = gallery.WHEEL_PX // 2
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
        found, seen = gallery.turned(flow_px, turns), np.rot90(marks, -turns)
        ((y, x),) = np.argwhere(seen == 1)
        ((y_to, x_to),) = np.argwhere(seen == 2)
        np.testing.assert_array_equal(found[y, x], [x_to - x, y_to - y])


def test_arrows_are_medians_of_squares_and_none_where_little_is_valid(tmp_path):
    flow_px = np.zeros((20, 40, 2), np.float32)
    flow_px[:, 20:] = (1.5, -0.5)
    flow_px[0, 0] = 1000.0
    valid = np.ones((20, 40), bool)
    valid[10:, 35:] = False
    np.savez(tmp_path / "a.npz", flow_px=flow_px, valid=valid)
    one = shown("a", None)._replace(flow=tmp_path / "a.npz")
    found = gallery.arrows(one)
    step = found["step"]
    assert (found["size"], step) == ([40, 20], 3)
    across = -(-40 // step)
    tips = [found["tips"][i : i + across] for i in range(0, len(found["tips"]), across)]
    assert tips[0][0] == [0, 0]
    assert tips[0][-1] == [15, -5]
    assert tips[-1][-1] is None
    turned = gallery.arrows(one._replace(turns=1))
    assert turned["size"] == [20, 40]
    # Right becomes down; up becomes right.
    assert [5, 15] in turned["tips"]


def test_captions_follow_the_layer(rng):
    photo = rng.integers(0, 256, (40, 60, 3), dtype=np.uint8)
    soft = (photo // 2 + 64).astype(np.uint8)
    one = shown("a", photo)
    one.layers["render"] = lambda: soft
    found = gallery.captions(one, photo_px=4.0)
    assert found["render"] == "render by base, 2.0 px from the photo"
    assert set(found) == {"photo", "render"}
