"""Crops at the photos' own size on the page."""

import base64
import io

import numpy as np
from PIL import Image

from alignerf.page import gallery, pictures


def shown(results):
    base = results / "base/round0"
    rounds = [(base / "renders/test", base / "flow/test")]
    return gallery.shown(results, rounds, {}, base, 0.25, "plain")


def decoded(uri):
    data = base64.b64decode(uri.partition(",")[2])
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def test_crops_are_of_their_photos_and_the_corrected_ones_lie_beside(results, crops):
    found = gallery.crops(*crops, shown(results))
    assert {key: len(entries) for key, entries in found.items()} == {
        "train/05": 2,
        "test/01": 1,
    }
    entry = found["test/01"][0]
    assert list(entry["layers"]) == ["photo", "render", "render, aligned"]
    # Cut two pixels further to the right, and one higher.
    assert entry["offset_px"] == [2, -1]
    assert decoded(entry["layers"]["photo"]).shape == (8, 8, 3)


def test_offsets_turn_with_the_photo(results, crops):
    every = [one._replace(turns=1) for one in shown(results)]
    # Right becomes down.
    assert gallery.crops(*crops, every)["test/01"][0]["offset_px"] == [1, 2]


def test_without_corrected_crops_there_is_no_after(results, crops):
    (entry,) = gallery.crops(crops[0], None, None, shown(results))["test/01"]
    assert list(entry["layers"]) == ["photo", "render"]
    assert "offset_px" not in entry
    assert gallery.crops(None, None, None, shown(results)) == {}


def test_what_does_not_fit_is_left_out_from_the_end(results, crops, monkeypatch):
    every = shown(results)
    first = gallery.crops(*crops, every[:1])
    size = sum(
        pictures.size_of(uri)
        for entry in first[every[0].key]
        for uri in entry["layers"].values()
    )
    monkeypatch.setattr(gallery, "CROPS_BYTES", size)
    assert list(gallery.crops(*crops, every)) == [every[0].key]
