"""The torture's minutes, its two workers, and what becomes of what fails in it."""

import math
import sys

import pytest

from tools.torture import __main__ as torture
from tools.torture import chains, clock, interrupts, parts, pool


class Time:
    """A clock that stands still until it is told to go on."""

    def __init__(self):
        self.s = 1000.0

    def __call__(self):
        return self.s


def test_every_part_has_a_share_and_all_are_less_than_an_hour():
    assert list(parts.SHARES) == list(parts.PARTS)
    assert sum(parts.SHARES.values()) == torture.parse([]).minutes == 20


def test_what_a_part_leaves_goes_to_those_after_it():
    time = Time()
    limit = clock.Clock(10, {"a": 5, "b": 3, "c": 2}, now=time)
    limit.begin("a")
    assert limit.until == 1000 + 300
    assert limit.of_next(2) == 1000 + 150
    time.s += 60
    limit.begin("b")
    assert limit.until == pytest.approx(time.s + 540 * 3 / 5)
    # It takes too long: the last one has what is left.
    time.s += 400
    limit.begin("c")
    assert limit.until == pytest.approx(1000 + 600)
    assert limit.has_room(4)
    assert not limit.has_room(5)


def test_without_minutes_nothing_is_cut():
    limit = clock.Clock(0, {"a": 1})
    limit.begin("a")
    assert limit.until == limit.of_next(7) == math.inf
    assert limit.has_room(1e9)
    assert not limit.is_limited


def test_two_workers_try_all_cases_in_folders_of_their_own(tmp_path):
    seen, places = [], [tmp_path / "a", tmp_path / "b"]

    def attack(case, place, rng):
        place.mkdir(exist_ok=True)
        seen.append((case, place, rng.integers(100)))
        return False if case % 2 else {4: "found"}.get(case)

    found = pool.tried(attack, range(10), until=math.inf, places=places, seed=1)
    assert found == (5, 5, ["found"])
    assert sorted(case for case, *_ in seen) == list(range(10))
    assert not any(place.exists() for place in places)
    numbers = {case: number for case, _, number in seen}
    pool.tried(attack, range(10), until=math.inf, places=places[:1], seed=1)
    assert {case: number for case, _, number in seen[10:]} == numbers


def test_nothing_is_tried_after_the_time(tmp_path):
    found = pool.tried(str, range(10), until=0, places=[tmp_path / "a"], seed=1)
    assert found == (0, 10, [])


def test_an_attack_that_fails_is_a_finding(tmp_path):
    found = pool.tried(
        lambda *_: 1 / 0, ["one"], until=math.inf, places=[tmp_path / "a"], seed=1
    )
    assert "one: the attack failed" in found.found[0]


def test_a_part_that_fails_does_not_end_the_torture(tmp_path, monkeypatch, capsys):
    def broken(*_):
        yield parts.Row("first", 3, 4, [])
        raise OSError("gone")

    def other(*_):
        yield parts.Row("other", 1, 1, ["it is gone"])

    monkeypatch.setattr(torture, "reference_of", lambda folder: None)
    monkeypatch.setattr(parts, "PARTS", {"numbers": broken, "names": other})
    assert torture.main(["--out", str(tmp_path)]) == 1
    rows = (tmp_path / "report.csv").read_text().splitlines()
    outcomes = "destroyed,silently_wrong,heavy,traceback"
    assert rows[0] == f"part,what,cases,of,findings,{outcomes},minutes"
    assert rows[1].startswith("numbers,first,3,4,0,0,0,0,0,")
    assert rows[2].startswith("numbers,the part itself,1,1,1,0,0,0,1,")
    assert rows[3].startswith("names,other,1,1,1,1,0,0,0,")
    assert "OSError: gone" in (tmp_path / "findings.txt").read_text()


def test_kills_are_shared_among_workers():
    assert pool.shared(50) == [25, 25]
    assert pool.shared(3) == [1, 2]
    assert pool.together([lambda: 1, lambda: 2, lambda: 3]) == [1, 2, 3]


@pytest.fixture
def begun(tmp_path):
    """What parts are given: no chain, a command line, a clock without an end."""
    limit = clock.Clock(0, {"a": 1})
    limit.begin("a")
    return None, torture.parse(["--out", str(tmp_path), "--kills", "5"]), limit


def test_the_rows_of_kills(begun, monkeypatch):
    def killed(reference, folder, kills, rng, until):
        return [f"{folder.name}: {kills}"], kills

    def trainings(reference, folder, kind, kills, rng, until):
        return [], kills - 1, 7

    monkeypatch.setattr(parts.interrupts, "killed", killed)
    monkeypatch.setattr(parts.interrupts, "trainings", trainings)
    assert list(parts.of_kills(*begun)) == [
        ("kill -9 of the chain", 5, 5, ["0: 2", "1: 3"]),
        ("kill -9 of a training", 15, 16, []),
        ("kill -9 of a training that aligns, 7 within an alignment", 15, 16, []),
    ]


def test_the_rows_of_machines(begun, monkeypatch):
    for name in ("full_disks", "memory_growth", "unwritable"):
        monkeypatch.setattr(parts.machines, name, lambda *_: None)
    monkeypatch.setattr(parts.interrupts, "stopped", lambda *_, rng: ["found"])
    rows = {row.what: row[1:] for row in parts.of_machines(*begun)}
    assert rows["full disks"] == (0, len(parts.machines.DISK_MIB), None)
    assert rows["SIGTERM and Ctrl-C"] == (2, 2, ["found"])
    reference, args, _ = begun
    late = clock.Clock(1, {"machines": 5})
    rows = list(parts.of_machines(reference, args, late))
    assert all((row.cases, row.found) == (0, []) for row in rows)


def test_the_rows_of_grown_folders(begun, monkeypatch):
    reference, args, limit = begun
    args.cases = 2
    monkeypatch.setattr(parts.grown, "SOURCES", {"llff": None})
    (row,) = parts.of_folders(reference, args, limit)
    assert row == ("grown folders of llff", 2, 2, [])


def life(tmp_path, script, **more):
    """A training that is nothing but a script, which tells its file what it does."""
    found = interrupts.Life(
        chains.Chain(tmp_path, tmp_path), tmp_path / "out", [], **more
    )
    head = "import os, time; file = open(os.environ['TOLD'], 'a', buffering=1)\n"
    found.command = [sys.executable, "-c", head + script]
    return found


def test_a_life_ends_within_an_alignment(tmp_path, rng):
    script = "print('running', file=file)\n" + 3 * (
        "print('aligning', file=file); time.sleep(0.6); print('aligned', file=file)\n"
    )
    aligning = life(tmp_path, script, aligns=True)
    assert aligning.lived(rng, 1) is None
    assert aligning.told()[0] == "running"
    assert aligning.is_aligning()
    # Nobody kills it: it ends by itself, after what its first life had told.
    assert aligning.lived(None, 3) == 0
    assert not aligning.is_aligning()


def test_a_life_may_end_before_its_first_step_or_by_itself(tmp_path, rng, monkeypatch):
    monkeypatch.setattr(interrupts, "START_KILL_S", (0.1, 0.2))
    assert life(tmp_path, "time.sleep(9)", aligns=False).lived(rng, 4) is None
    fails = life(tmp_path, "print('running', file=file); 1 / 0", aligns=False)
    monkeypatch.setattr(interrupts, "STEPS_KILL_S", (5.0, 6.0))
    assert fails.lived(rng, 0) == 1


def test_a_short_chain_has_some_of_the_files(tmp_path):
    whole, short = (
        chains.Chain(tmp_path, tmp_path / name) for name in ("whole", "short")
    )
    for chain, names in ((whole, ("a.txt", "b.txt")), (short, ("a.txt",))):
        for name in (*chains.SHORT, f"results/{chains.SCENE}/{names[-1]}"):
            path = chain.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("1")
    (whole.folder / "results" / chains.SCENE / "a.txt").write_text("1")
    assert chains.differences(whole, short, short=True) == []
    assert chains.differences(whole, short) == [f"results/{chains.SCENE}/b.txt"]
    (short.folder / chains.SHORT[0]).unlink()
    assert chains.differences(whole, short, short=True) == [chains.SHORT[0]]


def test_a_chain_of_other_sources_is_made_anew(tmp_path, monkeypatch):
    """Found once: a kept one's commit differed from that of each killed chain."""
    made = []

    def finish(chain):
        made.append(chain)
        path = chain.folder / "results" / chains.SCENE / "index.html"
        path.parent.mkdir(parents=True)
        path.touch()

    monkeypatch.setattr(chains, "finish", finish)
    for commit, count in (("a", 1), ("a", 1), ("b", 2)):
        monkeypatch.setattr(torture.provenance, "commit", lambda commit=commit: commit)
        torture.reference_of(tmp_path / "reference")
        assert len(made) == count
