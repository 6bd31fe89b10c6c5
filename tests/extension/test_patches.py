"""A patch of one new file adds what it registers, everywhere where others stand."""

import json

import pytest

SOFT = """
import json, pathlib, alignerf
from alignerf.experiment import sources
from alignerf.page import told as page
from alignerf.verdict import __main__ as verdict
from tests.alignerf.causes import cases

told = {}
for name, e in ("ours", cases.WELL), ("theirs", cases.THEIRS):
    for soft in (0.8, 0.5, 0.3):
        content = verdict.content_of(e._replace(detail_median=soft), [], [])
        pathlib.Path("verdict.json").write_text(json.dumps(verdict.plain(content)))
        told[f"{name} {soft}"] = page.read(pathlib.Path())
reached = {path.name for path in sources.reached("alignerf.verdict")}
print(json.dumps([told, "soft.py" in reached]))
"""


@pytest.fixture(scope="module")
def soft(patched):
    """Verdicts of a cause that is looked for besides."""
    return json.loads(patched("cause.patch")(SOFT))


@pytest.mark.parametrize("e", ["ours", "theirs"])
def test_a_cause_is_named_said_advised_on_and_shown(soft, e):
    told, reached = soft
    assert reached
    levels = {"0.8": "not seen", "0.5": "likely", "0.3": "sure"}
    for value, level in levels.items():
        found = told[f"{e} {value}"]
        gauge = found["gauges"][-1]
        assert (gauge["name"], gauge["level"]) == ("detail of all photos", level)
        # More is better.
        assert (gauge["filled"] > 0.5) == (level != "not seen")
        assert ("soft" in found["headline"]) == (level != "not seen")
        assert found["state"] == "aligned"
        if level == "not seen":
            assert not found["findings"]
            continue
        (finding,) = found["findings"]
        wanted = {"cause": "soft", "size": float(value), "sure": level == "sure"}
        assert finding == wanted
        assert f"{float(value):.2f} of their renders' detail" in found["because"][0]
        words = "enlarged" if e == "ours" else "as they were taken"
        assert words in found["do_first"]["text"]
