"""Photos of one sensor come to lie alike, however the phone was held."""

import numpy as np
import pytest

from alignerf.colmap import ingest
from alignerf.scenes import photos


def lay_alike(heads):
    sizes, lays = zip(*ingest.lay_alike(heads), strict=True)
    return sizes, lays


def test_what_most_photos_are_is_applied_to_all():
    sizes, lays = lay_alike([((400, 300), 6)] * 3 + [((400, 300), 1)] * 2)
    assert set(sizes) == {(300, 400)}
    assert {lay.kind for lay in lays} == {"sensor"}
    assert {lay.orientation for lay in lays} == {6}
    # A landscape photo among portraits lies on its side; three turns put it right.
    assert [lay.turns for lay in lays] == [0, 0, 0, 3, 3]


@pytest.mark.parametrize("number", range(1, 9))
def test_turns_make_a_photo_stand_as_it_was_meant_to(number):
    stored = np.arange(12, dtype=np.uint8).reshape(3, 4, 1).repeat(3, 2)
    meant = photos.UPRIGHT[number](stored)
    _, lays = lay_alike([((4, 3), 1)] * 3 + [((4, 3), number)])
    lies = lays[3].apply(stored)
    assert lies.shape == (3, 4, 3)
    np.testing.assert_array_equal(np.rot90(lies, -lays[3].turns), meant)
    # A mirrored photo is of no sensor that the others have.
    assert (lays[3].kind == "sensor") == (number in ingest.TURNS)


def test_photos_across_without_a_word_are_turned_back():
    stored = np.arange(12, dtype=np.uint8).reshape(4, 3, 1)
    sizes, lays = lay_alike([((4, 3), 1)] * 2 + [((3, 4), 1)])
    assert set(sizes) == {(4, 3)}
    assert [lay.kind for lay in lays] == ["sensor", "sensor", "across"]
    lies = lays[2].apply(stored)
    assert lies.shape == (3, 4, 1)
    np.testing.assert_array_equal(np.rot90(lies, -lays[2].turns), stored)


def test_of_equally_many_the_rows_stay_as_stored():
    _, lays = lay_alike([((4, 3), 6), ((4, 3), 1)])
    assert [lay.orientation for lay in lays] == [1, 1]
    assert [lay.turns for lay in lays] == [1, 0]


@pytest.mark.parametrize(
    ("head", "size", "turns", "kind"),
    [
        (((8, 5), 1), (8, 5), 0, "8x5"),
        # Portrait among landscapes, by EXIF's word or without.
        (((8, 5), 6), (8, 5), 1, "8x5 across"),
        (((5, 8), 1), (8, 5), 1, "8x5 across"),
        (((6, 6), 1), (6, 6), 0, "6x6"),
    ],
)
def test_another_size_lies_with_its_longer_side_as_the_others(head, size, turns, kind):
    sizes, lays = lay_alike([((4, 3), 1)] * 2 + [head])
    assert sizes[2] == size
    assert (lays[2].turns, lays[2].kind) == (turns, kind)
    stored = np.arange(np.prod(head[0]), dtype=np.uint8).reshape(*head[0][::-1], 1)
    lies = lays[2].apply(stored)
    assert lies.shape[1::-1] == size
    upright = photos.UPRIGHT[head[1]](stored)
    np.testing.assert_array_equal(np.rot90(lies, -turns), upright)


def test_a_square_photo_lies_any_way():
    sizes, lays = lay_alike([((4, 4), 6), ((4, 4), 1)])
    assert set(sizes) == {(4, 4)}
    assert {lay.kind for lay in lays} == {"sensor"}
