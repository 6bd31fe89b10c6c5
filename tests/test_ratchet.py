"""Code and pages may get smaller; what makes them larger is written down."""

from types import SimpleNamespace

import pytest
import yaml

from tests import ratchet


@pytest.mark.parametrize("unit", ratchet.COUNTS)
def test_nothing_grows_without_a_reason(unit):
    found = list(ratchet.faults(unit, ratchet.COUNTS[unit](), ratchet.limits(unit)))
    assert not found, "\n".join(["", *found])


def test_entries_are_numbers_or_say_why_and_what_went():
    for unit, part in yaml.safe_load(ratchet.LIMITS.read_text()).items():
        for name, entry in part.items():
            if isinstance(entry, dict) and unit != "seconds":
                assert all(entry[key].strip() for key in ("reason", "gone")), name


def test_code_is_neither_blank_nor_comment_nor_docstring(tmp_path):
    path = tmp_path / "a.py"
    path.write_text(
        '"""Doc\n\nof it."""\n\n# why\nx = """a\n\nb"""  # three\n\n\n'
        'class A:\n    """Doc."""\n\n    def f(self):\n        "Doc."\n        # why\n'
        "        return [\n            1,\n        ]\n"
    )
    assert ratchet.code_lines(path) == 8


def test_rises_and_far_falls_are_told():
    def told(now, limit):
        return list(ratchet.faults("lines", {"a": now}, {"a": limit}))

    assert not told(100, 100) + told(100, 130) + told(2000, 2060)
    assert told(1101, 1100) == [
        "a: 1,101 lines, 1 above its 1,100: cut, or raise the limit in "
        "tests/ratchet.yaml with a reason and what went"
    ]
    assert "far below its 131: lower the limit" in told(100, 131)[0]
    assert "raise the limit" in next(ratchet.faults("lines", {"b": 1}, {}))
    assert "there is none" in next(ratchet.faults("lines", {}, {"b": 1}))


def test_what_has_fallen_is_written_and_the_rest_stays(tmp_path, monkeypatch):
    before = (
        "# Why.\nlines:\n  a: 90\n  a/b: {lines: 70, reason: 'was 60'}\n  c: 5\n"
        "words:\n  a: 300\nseconds:\n  default: 120\n"
    )
    monkeypatch.setattr(ratchet, "LIMITS", tmp_path / "ratchet.yaml")
    counts = {"lines": {"a": 80, "a/b": 65, "c": 9}, "words": {"a": 200}}
    monkeypatch.setattr(
        *(ratchet, "COUNTS"),
        {unit: lambda unit=unit: counts[unit] for unit in counts},
    )
    ratchet.LIMITS.write_text(before)
    ratchet.lower()
    after = before.replace("90", "80").replace("lines: 70", "lines: 65")
    assert ratchet.LIMITS.read_text() == after.replace("300", "200")


def test_seconds_are_of_folders(monkeypatch):
    def report(nodeid, duration):
        return SimpleNamespace(nodeid=nodeid, duration=duration)

    stats = {
        "": [report("tests/a/test_a.py::test_a[x/y]", 2.0)],
        "passed": [report("tests/a/test_b.py::test_b", 3.0), report("tests/t.py", 4.0)],
        "subtests passed": [
            SimpleNamespace(nodeid="tests/a/b.py::c", duration=1.0, context="a part")
        ],
        "deselected": [SimpleNamespace(nodeid="tests/a/test_a.py::test_c")],
    }
    totals = ratchet.seconds(stats)
    assert totals == {"tests/a": 5.0, "tests": 4.0}
    monkeypatch.setattr(ratchet, "limits", lambda unit: {"default": 3, "tests/a": 6})
    assert list(ratchet.slow(totals)) == ["tests: 4 s of tests, budget 3 s"]
