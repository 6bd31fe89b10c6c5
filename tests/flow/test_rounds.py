"""Rounds end where what remains between renders and their photos no longer falls."""

import json

import numpy as np
import pytest

from flow import rounds
from flow.warping import files


@pytest.mark.parametrize(
    ("before_px", "now_px", "goes_on"),
    [
        (None, 1.0, True),
        (None, 0.0, False),
        (1.0, 0.5, True),
        (1.0, 1.0, False),
        (1.0, 0.95, False),
        (1.0, 2.0, False),
        (0.0, 0.0, False),
        (0.0, 1.0, False),
        (1e-30, 0.5e-30, True),
    ],
)
def test_goes_on_while_it_falls(before_px, now_px, goes_on):
    found, reason = rounds.decide(now_px, before_px)
    assert found == goes_on
    assert f"{now_px:.3f} px remain" in reason


def test_the_min_fall_is_a_fraction():
    assert rounds.decide(75.0, 100.0, min_fall=0.25)[0]
    assert not rounds.decide(75.0, 100.0, min_fall=0.26)[0]


def write(folder, flows, valid=True):
    """A folder of flows; a flow is the same vector at all pixels, or an array."""
    folder.mkdir()
    for view, flow_px in flows.items():
        whole = np.broadcast_to(np.float32(flow_px), (6, 8, 2))
        mask = np.broadcast_to(valid, (6, 8)).copy()
        files.write_flow(folder / f"{view}.npz", whole, mask)
    return folder


def test_what_remains_is_the_change_of_the_flow(tmp_path):
    """Not the flow itself, which may grow while the rounds converge."""
    first = write(tmp_path / "first", {"a": [3.0, 4.0], "b": [1.0, 0.0]})
    second = write(tmp_path / "second", {"a": [6.0, 8.0], "b": [1.0, 0.0]})
    assert rounds.remaining_px(first) == 3.0
    assert rounds.remaining_px(second, first) == 2.5
    assert rounds.remaining_px(second, second) == 0.0


def test_only_pixels_valid_in_both_count(tmp_path):
    flow_px = np.zeros((6, 8, 2))
    flow_px[:3] = 100.0
    lower = np.arange(6)[:, None] >= 3
    first = write(tmp_path / "first", {"a": flow_px}, valid=lower)
    second = write(tmp_path / "second", {"a": [0.0, 2.0]})
    assert rounds.remaining_px(second, first) == 2.0
    upper = write(tmp_path / "upper", {"a": flow_px}, valid=~lower)
    with pytest.raises(ValueError, match=r"a\.npz: no valid pixel"):
        rounds.remaining_px(first, upper)


def run(out, flow, *before):
    arguments = ["--flow", flow, "--out", out]
    for name, value in zip(("--before-flow", "--before"), before, strict=False):
        arguments += [name, value]
    return rounds.run([str(part) for part in arguments])


def test_each_decision_builds_on_the_one_before(tmp_path):
    flows = [
        write(tmp_path / str(k), {"a": [length_px, 0.0]})
        for k, length_px in enumerate([1.0, 1.5, 1.75, 2.0])
    ]
    decisions = [tmp_path / f"{k}.json" for k in range(4)]
    assert run(decisions[0], flows[0]) == 0
    for k in (1, 2, 3):
        assert run(decisions[k], flows[k], flows[k - 1], decisions[k - 1]) == 0
    found = [json.loads(path.read_text()) for path in decisions]
    assert [f["remaining_px"] for f in found] == [1.0, 0.5, 0.25, 0.25]
    assert [f["go_on"] for f in found] == [True, True, True, False]
    assert found[3]["reason"] == (
        "0.250 px remain, 0.250 px before: the least fall of 10% is not reached"
    )


def test_cameras_go_on_until_their_corrections_no_longer_shrink(tmp_path, capsys):
    found = []
    for k, px in enumerate([1.2, 0.4, 0.39]):
        report, out = tmp_path / f"report{k}.json", tmp_path / f"{k}.json"
        report.write_text(json.dumps({"correction_px": px}))
        more = ["--before", str(tmp_path / f"{k - 1}.json")] if k else []
        arguments = ["--corrections", str(report), "--out", str(out), *more]
        assert rounds.run(arguments) == 0
        found.append(json.loads(out.read_text()))
    assert [f["go_on"] for f in found] == [True, True, False]
    assert [f["remaining_px"] for f in found] == [1.2, 0.4, 0.39]
    report.write_text("{}")
    assert rounds.run(arguments) == 1
    assert (
        "report2.json: not the JSON that it should be: no correction_px"
        in capsys.readouterr().err
    )
    assert rounds.run(["--out", str(out)]) == 1


@pytest.mark.parametrize(
    ("break_it", "reason"),
    [
        (lambda f: (f / "flow" / "a.npz").unlink(), "flow: no flow"),
        (lambda f: (f / "flow" / "a.npz").write_bytes(b"PK"), r"a.npz: not the .npz"),
        (lambda f: (f / "before" / "a.npz").unlink(), "before/a.npz"),
        (
            lambda f: (f / "before.json").write_text("{}"),
            "before.json: not the JSON",
        ),
        (
            lambda f: (f / "before.json").write_text("["),
            "before.json: not the JSON",
        ),
        (lambda f: (f / "before.json").unlink(), "before.json"),
    ],
)
def test_bad_files_are_named(tmp_path, capsys, break_it, reason):
    for name in ("flow", "before"):
        write(tmp_path / name, {"a": [1.0, 0.0]})
    (tmp_path / "before.json").write_text('{"remaining_px": 1.0}')
    break_it(tmp_path)
    out = tmp_path / "decision.json"
    before = (tmp_path / "before", tmp_path / "before.json")
    assert run(out, tmp_path / "flow", *before) == 1
    error = capsys.readouterr().err
    assert reason in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_another_size_is_named(tmp_path):
    first = write(tmp_path / "first", {"a": [1.0, 0.0]})
    second = tmp_path / "second"
    second.mkdir()
    whole = np.zeros((5, 8, 2), np.float32), np.ones((5, 8), bool)
    files.write_flow(second / "a.npz", *whole)
    with pytest.raises(ValueError, match=r"second/a\.npz: another size"):
        rounds.remaining_px(first, second)
