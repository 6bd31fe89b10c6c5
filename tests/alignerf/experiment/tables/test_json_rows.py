"""Rows as JSON: what a rule writes is what a command reads, or is refused by name."""

import json
from typing import NamedTuple

import pytest

from alignerf.experiment.tables import json_rows, rows, scenes


class Part(NamedTuple):
    path: str
    size: int | float | None


class Row(NamedTuple):
    name: str
    parts: list[Part]
    first: Part
    texts: list[str]
    options: dict
    more: str | None = None


WHOLE = Row("a", [Part("x", 1), Part("y", None)], Part("z", 2.5), ["t"], {"k": [1]})


@pytest.mark.parametrize(
    ("kind", "row"),
    [
        (Row, WHOLE),
        (Row, WHOLE._replace(more="m", parts=[])),
        (rows.Row, rows.Row("m/round0", [], [], [], {})),
        (rows.Row, rows.Row("m", ["m"], ["n"], [], {"scores": "m.csv"}, "m", 0)),
        (rows.Renders, rows.Renders("r", "f")),
        (scenes.Scene, scenes.Scene("a", 0, "", "", "", 1, None, 5, 0.5, "m")),
    ],
)
def test_what_is_written_is_read(kind, row):
    text = json_rows.as_json([row, row])
    assert json_rows.read(kind, text) == [row, row]
    assert all(type(found) is kind for found in json_rows.read(kind, text))


def test_a_key_is_left_out_only_where_it_has_its_default():
    (found,) = json.loads(json_rows.as_json([WHOLE]))
    assert "more" not in found
    assert found["parts"][1] == {"path": "y", "size": None}
    (found,) = json.loads(json_rows.as_json([rows.Renders("r", "f")]))
    assert found == {"renders": "r", "flow": "f"}


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"other": 1}, r"--rows\[0\]\.other: Extra inputs"),
        ({"name": None}, r"--rows\[0\]\.name: Input should be a valid string"),
        ({"parts": [{"path": "x"}]}, r"--rows\[0\]\.parts\[0\]\.size: Field required"),
        ({"parts": {}}, r"--rows\[0\]\.parts: Input should be a valid array"),
        ({"first": 3}, r"--rows\[0\]\.first: Input should be an array or an object"),
        ({"texts": [1]}, r"--rows\[0\]\.texts\[0\]: Input should be a valid string"),
        ({"more": 1}, r"--rows\[0\]\.more: Input should be a valid string"),
        ({"options": []}, r"--rows\[0\]\.options: Input should be an object"),
    ],
)
def test_other_keys_and_values_are_refused_by_name(change, reason):
    (whole,) = json.loads(json_rows.as_json([WHOLE]))
    with pytest.raises(ValueError, match=reason):
        json_rows.read(Row, json.dumps([whole | change]))


def test_a_missing_key_is_named():
    (whole,) = json.loads(json_rows.as_json([WHOLE]))
    del whole["texts"]
    with pytest.raises(ValueError, match=r"--rows\[0\]\.texts: Field required"):
        json_rows.read(Row, json.dumps([whole]))


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, "{}", "3", "[3]", "[]"])
def test_what_is_no_list_of_rows_is_refused(text):
    for option in ("--rows", "--scenes"):
        with pytest.raises(ValueError, match=f"^{option}") as refused:
            json_rows.read(Row, text, option)
        assert "\n" not in str(refused.value)
