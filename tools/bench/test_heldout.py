"""Held-out captures are looked at once for each release of the rules, on record."""

import math
import shutil
from pathlib import Path

import pandas as pd
import pytest

from alignerf.io import provenance
from tests.alignerf.causes import cases
from tests.alignerf.causes.cases import THEIRS
from tools.bench import captures, heldout, limits, measure

NAMES = sorted(captures.of(captures.HELD_OUT))
MEASURED, BESIDE = Path("docs/measured"), ("verdicts.csv", "verdict_faults.csv")


@pytest.fixture
def looked(tmp_path, root, monkeypatch):
    """Runs the command on made-up cases: (release, rules) -> the table of looks."""
    planted, out = tmp_path / "planted", tmp_path / "out"
    out.mkdir()
    for name in BESIDE:
        shutil.copy(root / MEASURED / name, out)

    def run(release, rules, *more, commit="0" * 40):
        monkeypatch.setattr(captures, "RELEASE", release)
        monkeypatch.setattr(measure, "digest", lambda *folders: rules)
        monkeypatch.setattr(provenance, "commit", lambda: commit)
        write_cases(planted, rules)
        folders = [str(planted / name) for name in NAMES]
        arguments = [str(planted), "--captures", *folders, "--out", str(out), *more]
        heldout.main(arguments)
        return heldout.looks_of(out / heldout.LOOKS)

    return run


def write_cases(folder, rules):
    """Of each capture one case without a fault, and one with a strong one, found.

    Of the last capture the fault was not found, and another cause is, surely.
    """
    rows = []
    for name in NAMES:
        for fault, ev, db in (("nothing", 0.01, 20.0), ("exposure", 0.5, 18.0)):
            (case := folder / name / f"{fault}0").mkdir(parents=True, exist_ok=True)
            (case / "case.json").write_text("{}")
            known = THEIRS._replace(exposure_ev=ev, shared_ev=math.nan)
            if name == NAMES[-1] and ev > 0.1:
                known = THEIRS._replace(blurred_fraction=0.2)
            row = {"capture": name, "reading": "renders", "refused": math.nan}
            row |= {"faults": fault, "strengths": 0, "seed": 0, "score_db": db}
            rows.append(row | limits.flat(known))
    pd.DataFrame(rows).to_csv(folder / f"heldout_{rules}.csv", index=False)


def test_a_look_is_recorded_and_not_repeated(looked, tmp_path, root):
    first = looked(1, "0123456789ab")
    own = first[first["role"] == "held out"].set_index("read_as")
    (row,) = own.loc[["its renders"]].to_dict("records")
    assert (row["first"], row["first_of"]) == (len(NAMES) - 1, len(NAMES))
    assert row["cases"] == 2 * len(NAMES)
    assert row["false_each"] == pytest.approx(1 / (2 * len(NAMES)), abs=1e-3)
    assert (row["sure_right"], row["sure"]) == (len(NAMES) - 1, len(NAMES))
    # Beside it: what the captures for development say.
    theirs = pd.read_csv(root / MEASURED / BESIDE[0], comment="#")
    every = theirs[theirs["capture"] == "all"].set_index("read_as")
    beside = first[first["role"] == "development"].set_index("read_as")
    for read_as in limits.READ_AS.values():
        assert beside.loc[read_as, "first"] == every.loc[read_as, "first"]
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    pd.testing.assert_frame_equal(looked(1, "0123456789ab"), first)
    for path, content in before.items():
        assert path.read_bytes() == content, path
    table = pd.read_csv(tmp_path / "out" / heldout.BY_CAPTURE, comment="#")
    assert {*table["capture"]} == {*NAMES, "all"}
    assert {*table["release"]} == {1}
    table = pd.read_csv(tmp_path / "out" / heldout.BY_FAULT, comment="#")
    table = table.set_index("fault")
    assert table.loc["exposure", "first"] == len(NAMES) - 1
    assert {*table.index} == {"nothing", "exposure"}
    theirs = pd.read_csv(root / MEASURED / BESIDE[1], comment="#").set_index("fault")
    for name in table.index:
        assert table["development_first"][name] == theirs["first"][name]


def test_other_rules_need_another_release(looked):
    first = looked(1, "0" * 12)
    with pytest.raises(SystemExit, match=r"raise `release` in .*captures\.yaml"):
        looked(1, "1" * 12)
    second = looked(2, "1" * 12)
    assert second["digest"].unique().tolist() == ["0" * 12, "1" * 12]
    assert second["release"].unique().tolist() == [1, 2]
    assert len(second) == 2 * len(first)
    for release in (1, 2):
        with pytest.raises(SystemExit, match="release 2 were looked at"):
            looked(release, "2" * 12)


def test_a_look_is_of_rules_on_record_and_at_all_cases(looked, tmp_path):
    with pytest.raises(SystemExit, match="commit the rules first"):
        looked(1, "0" * 12, commit="0123456-dirty")
    more = tmp_path / "planted" / NAMES[2] / "poses1"
    more.mkdir(parents=True)
    (more / "case.json").write_text("{}")
    with pytest.raises(SystemExit, match=f"{NAMES[0]}/poses1, {NAMES[1]}/poses1"):
        looked(1, "0" * 12)
    assert not (tmp_path / "out" / heldout.LOOKS).exists()
    folders = [str(tmp_path / name) for name in [*NAMES[1:], "fox"]]
    arguments = [str(tmp_path), "--captures", *folders, "--out", str(tmp_path)]
    with pytest.raises(SystemExit, match=rf"{NAMES[0]}, fox$"):
        heldout.main(arguments)


def test_splats_are_judged_in_the_same_look(looked, tmp_path):
    rows = []
    for fault, known in (
        ("nothing", THEIRS),
        ("poses", THEIRS._replace(**cases.FAULTS["camera"])),
        ("exposure", THEIRS),
    ):
        row = {"name": fault, "trainer": "OpenSplat", "capture": NAMES[0], "seed": 0}
        row |= {"faults": fault, "strengths": 1, "reading": "renders", "refused": None}
        rows.append(row | limits.flat(known) | {"depth": "points"})
    path = tmp_path / "rows.csv"
    pd.DataFrame(rows).to_csv(path, index=False)
    looked(1, "0" * 12, "--splats", str(path))
    found = pd.read_csv(tmp_path / "out" / heldout.SPLATS, comment="#")
    assert found["right"].tolist() == ["yes", "yes", "no"]
    path.write_text(path.read_text().replace(f",{NAMES[0]},", ",fox,"))
    with pytest.raises(SystemExit, match="not held out: fox"):
        looked(2, "1" * 12, "--splats", str(path))


def test_rules_are_not_made_with_captures_that_are_held_out(tmp_path):
    path = tmp_path / "rows.csv"
    pd.DataFrame({"capture": ["fox", NAMES[0]]}).to_csv(path, index=False)
    for arguments in (
        ["collect", str(tmp_path), "--captures", f"results/{NAMES[0]}", "--out", "a"],
        ["fit", str(path), "--out", str(tmp_path)],
    ):
        with pytest.raises(SystemExit, match=f"held out.*{NAMES[0]}$"):
            limits.main(arguments)


def test_tables_keep_roles_apart(root):
    for name, role in (
        (BESIDE[0], captures.DEVELOPMENT),
        (heldout.BY_CAPTURE, captures.HELD_OUT),
    ):
        table = pd.read_csv(root / MEASURED / name, comment="#")
        assert {*table["capture"]} <= captures.of(role) | {"all"}, name


def test_the_last_look_is_of_the_rules_as_they_are(root):
    """Else: raise `release` in captures.yaml, and look again by tools.bench.heldout."""
    looks = heldout.looks_of(root / MEASURED / heldout.LOOKS)
    table = pd.read_csv(root / MEASURED / heldout.BY_CAPTURE, comment="#")
    if len(looks):
        assert {*table["release"]} == {looks["release"].iloc[-1]} == {captures.RELEASE}
        assert looks["outcomes"].iloc[-1] == heldout.outcomes()
    else:
        assert table["first"][table["role"] == "held out"].isna().all()
