"""Corrections on disk: what is damaged or another training's counts as none."""

import numpy as np
import pytest

from alignerf.alignment import store
from tests import plane_scene as plane


@pytest.mark.parametrize("way", ["cut", "altered", "manifest", "identity", "elsewhere"])
def test_damaged_alignments_count_as_none(wrong, way, caplog):
    loaded, _, folder = wrong
    plane.aligner_of(loaded, folder).align({}, 2)
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
    other = plane.aligner_of(loaded, folder)
    if way == "identity":
        other.begin(10, "another")
    assert not other.restore(3)
    assert ("alignment not usable" in caplog.text) == (way != "identity")


def test_arrays_of_another_shape_are_refused(wrong):
    loaded, _, folder = wrong
    size = plane.aligner_of(loaded, folder).sizes()
    arrays = {name: np.zeros(shape, dtype) for name, (shape, dtype) in size.items()}
    store.check(arrays, size)
    with pytest.raises(ValueError, match="not this training's"):
        store.check({**arrays, "offsets_px": arrays["offsets_px"][:2]}, size)
    arrays["camtoworlds"][0, 0, 0] = np.nan
    with pytest.raises(ValueError, match="camtoworlds is not finite"):
        store.check(arrays, size)
