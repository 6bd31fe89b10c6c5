"""The keys of the scene that is exported by hand."""

import pytest

from alignerf.exports import written


def test_a_scene_that_stands_beside_its_crops_is_found_by_its_folder(tmp_path):
    folder = tmp_path / "chair"
    folder.mkdir()
    assert written.config_of(None, folder) is None
    path = folder / "config.yaml"
    path.write_text("scenes: {chair: {path: a}, chair_crops: {path: b}}\n")
    assert written.config_of(None, folder) == {"path": "a"}
    path.write_text("scenes: {other: {path: c}}\n")
    assert written.config_of(None, folder) == {"path": "c"}
    path.write_text("scenes: {one: {path: a}, two: {path: b}}\n")
    with pytest.raises(ValueError, match=r"config\.yaml: not the config of one scene"):
        written.config_of(None, folder)
