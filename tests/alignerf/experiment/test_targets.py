"""What is said in the end: verdicts as they are, or a line that names a file."""

import json

import pytest

from alignerf.experiment import targets


def write(folder, content):
    folder.mkdir()
    (folder / "verdict.json").write_text(json.dumps(content))


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ({}, "not the JSON that it should be: no verdict in it"),
        ([], "not the JSON that it should be: not an object"),
        ({"verdict": ""}, "not the JSON that it should be: verdict is ''"),
    ],
)
def test_what_says_nothing_is_named(tmp_path, content, fault):
    write(tmp_path / "a", content)
    with pytest.raises(ValueError, match=rf"^{tmp_path}/a/verdict\.json: {fault}"):
        targets.verdicts(["a"], results=tmp_path)


def test_scenes_without_a_verdict_are_left_out(tmp_path):
    write(tmp_path / "b", {"verdict": ["Aligned.", "\x1b[1mFine."]})
    lines = targets.verdicts(["a", "b"], results=tmp_path)
    assert lines == ["", "b", "  Aligned.", r"  \x1b[1mFine."]
