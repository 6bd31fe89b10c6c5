"""Planted faults are what they say, and limits are judged by captures left out."""

import json
import math
import sys
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from alignerf.causes import exposure
from alignerf.causes.shared import at_stake
from alignerf.io import images
from alignerf.sfm import matches
from tests import judged_cases
from tests.alignerf.causes.cases import MATCHES, THEIRS
from tests.alignerf.sfm import made
from tools.bench import faults, limits, planted, splat_cases, splats

COUNT = 12


@pytest.fixture
def capture(rng):
    cameras = made.cameras(COUNT)
    photos = [judged_cases.picture(60 + i, (160, 120)) for i in range(COUNT)]
    return faults.Capture(
        names=[f"v{i:02}" for i in range(COUNT)],
        split=np.array(["test" if i % 8 == 0 else "train" for i in range(COUNT)]),
        photos=np.array(photos),
        pixtocams=cameras.pixtocams * np.array([4.0, 4.0, 1.0]),
        camtoworlds=cameras.camtoworlds,
        points=rng.normal(scale=0.3, size=(200, 3)),
    )


@pytest.mark.parametrize(
    "name", [name for name, one in faults.PLANTS.items() if one.before]
)
def test_a_fault_put_in_before_changes_what_it_names_and_no_shape(capture, rng, name):
    plant = faults.PLANTS[name]
    kept = capture.photos.copy(), capture.camtoworlds.copy()
    for strength in plant.strengths:
        found = plant.before(capture, strength, rng)
        same = [
            len(a) == len(b) and np.array_equal(a, b)
            for a, b in zip(found, capture, strict=True)
            if not isinstance(a, float)
        ]
        assert not (all(same) and found.fraction == 1), strength
        assert len(found.photos) == len(found.names) == len(found.camtoworlds)
        assert found.photos.dtype == np.uint8
        assert np.isfinite(found.camtoworlds).all()
    # What was given stays.
    np.testing.assert_array_equal(kept[0], capture.photos)
    np.testing.assert_array_equal(kept[1], capture.camtoworlds)


@pytest.mark.parametrize(
    "name", [name for name, one in faults.PLANTS.items() if one.after]
)
def test_a_fault_put_in_after_changes_renders(capture, rng, name):
    plant, depth = faults.PLANTS[name], np.full((COUNT, 120, 160), 4.0)
    for strength in plant.strengths:
        renders, near = plant.after(capture.photos, depth, strength, rng)
        assert renders.shape == capture.photos.shape
        assert renders.dtype == np.uint8
        assert (renders != capture.photos).any()
        assert (near.min() < 1) == (name == "floaters")


def test_a_moving_patch_moves_by_its_length(capture, rng):
    moved = faults.moving(capture, 5.0, rng).photos
    share = (moved != capture.photos).any(axis=-1).mean()
    assert 0.05 < share < 0.9


def test_cases_are_those_of_the_registry():
    found = planted.cases([Path("a"), Path("b")])
    assert len({(one.capture, one.name) for one in found}) == len(found)
    assert {name for one in found for name, _ in one.plants} == {*faults.PLANTS}
    # What others take renders from comes first.
    assert all(one.name.startswith("nothing") for one in found[:4])


TRAINER = """#!{python}
import json, pathlib, sys
folder, words = pathlib.Path(sys.argv[1]), sys.argv[2:]
options = dict(zip(words[::2], words[1::2]))
pathlib.Path(options["-o"]).write_text("splat")
(folder / "told.json").write_text(json.dumps(options))
"""


@pytest.mark.parametrize("variant", splat_cases.VARIANTS)
def test_a_splat_s_case_is_as_users_have_it(variant, capture, tmp_path):
    fault, steps = splat_cases.VARIANTS[variant]
    folder = tmp_path / variant
    splat_cases.write(folder, capture, fault)
    photos = [images.read(folder / "images" / f"{n}.png") for n in capture.names]
    same = np.array_equal(photos, capture.photos)
    assert same == (variant in ("good", "short", "wrong_poses"))
    scene = json.loads((folder / "transforms.json").read_text())
    poses = [frame["transform_matrix"][:3] for frame in scene["frames"]]
    assert np.allclose(poses, capture.camtoworlds) == (variant != "wrong_poses")
    assert b"element vertex 200" in (folder / "points.ply").read_bytes()
    (trainer := tmp_path / "trainer").write_text(TRAINER.format(python=sys.executable))
    trainer.chmod(0o755)
    splat_cases.train(folder, trainer, steps)
    told = json.loads((folder / "told.json").read_text())
    held_out = [name for name in scene["test_filenames"]]
    names = sorted(frame["file_path"] for frame in scene["frames"])
    assert names[:: int(told["--hold-every"])] == held_out
    assert (int(told["-n"]), float(told["-d"])) == (steps, 1.0)
    trainer.write_text("#!/bin/sh\nexit 3\n")
    with pytest.raises(ValueError, match=r"train\.log: ended with 3"):
        splat_cases.train(folder, trainer, steps)


@pytest.mark.parametrize("said", ["error: it shows other photos", "Traceback"])
def test_a_splat_that_is_refused_is_recorded_and_the_next_is_judged(
    tmp_path, monkeypatch, said
):
    def write(folder, *_):
        folder.mkdir(parents=True)
        (folder / "splat.ply").write_text("")

    def run(command, folder, log, cwd=None):
        (folder / log).write_text(f"reads\n{said}\nends")
        if folder.name == "a_short":
            raise ValueError(f"{log}: ended with 1")

    monkeypatch.setattr(splat_cases, "write", write)
    monkeypatch.setattr(splat_cases, "run", run)
    monkeypatch.setattr(planted, "load", lambda *_: None)
    monkeypatch.setattr(splats, "judged", lambda results, case: case)
    words = [*("a", "--out", str(tmp_path), "--opensplat", "x")]
    words += ["--variants", "short", "good"]
    if said == "Traceback":
        with pytest.raises(ValueError, match="ended with 1"):
            splat_cases.main(words)
        return
    splat_cases.main(words)
    short, good = pd.read_csv(tmp_path / "splat_rows.csv").to_dict("records")
    assert (short["refused"], short["faults"]) == ("it shows other photos", "short")
    assert good["name"] == "a_good"
    assert not isinstance(good["refused"], str)


def test_points_have_the_colours_of_photos(capture):
    plain = np.zeros_like(capture.photos) + np.array([9, 90, 200], np.uint8)
    found = splat_cases.colours_of(capture.points, capture._replace(photos=plain))
    seen = (found == [9, 90, 200]).all(axis=1)
    assert seen.mean() > 0.5
    assert (found[~seen] == 128).all()


def test_an_evidence_outlives_the_table(tmp_path):
    row = {"capture": "a", "reading": "renders", "refused": math.nan}
    known = THEIRS._replace(matches=MATCHES._replace(kept=("focal", "distortion")))
    row |= {"faults": "poses", "seed": 0, "score_db": 20.0} | limits.flat(known)
    pd.DataFrame([row]).to_csv(tmp_path / "rows.csv", index=False)
    (again,) = pd.read_csv(tmp_path / "rows.csv").to_dict("records")
    found = limits.evidence_of(again)
    assert found.octaves == pytest.approx(THEIRS.octaves)
    assert found.flow_train_px == THEIRS.flow_train_px
    assert found.matches.kept == known.matches.kept
    older = {key: one for key, one in again.items() if "matches" not in key}
    assert limits.evidence_of(older).matches is None


def test_limits_are_fitted_without_the_capture_that_they_judge(monkeypatch):
    """One capture whose exposure is 0.09 without a fault moves the others' limit."""
    monkeypatch.setattr(limits, "LIMITS", {(exposure, "EXPOSURE_EV"): 0.06})
    rows = []
    for capture, usual in (("a", 0.09), ("b", 0.01), ("c", 0.01)):
        for name, more in (("nothing", 0.0), ("exposure", 0.11)):
            known = THEIRS._replace(exposure_ev=usual + more, shared_ev=math.nan)
            row = {"capture": capture, "reading": "renders", "refused": math.nan}
            row |= {"faults": name, "seed": 0, "score_db": 20.0 - 10 * more}
            row["strengths"] = "1"
            rows.append(row | limits.flat(known))
    table = pd.DataFrame(rows)
    before = exposure.EXPOSURE_EV
    found, strong = limits.left_out(table)
    assert before == exposure.EXPOSURE_EV
    assert strong.tolist() == [False, True] * 3
    # It is judged by limits that know nothing like it.
    assert [one.found for one in found[:2]] == [["exposure"], ["exposure"]]
    assert [one.found for one in found[2:]] == [[], ["exposure"]] * 2


def test_intervals_are_over_captures(rng):
    """They hold the share of all captures where cases of one are alike."""
    held, wide = 0, []
    for _ in range(400):
        shares = rng.beta(4, 1, 8)
        captures = np.repeat(np.arange(8), rng.integers(10, 40, 8))
        right = pd.Series(rng.random(len(captures)) < shares[captures])
        low, high = limits.over_captures(right, pd.Series(captures))
        held += low <= 0.8 <= high
        wide.append(high - low)
    assert 0.89 < held / 400 < 0.99
    assert np.median(wide) < 0.4
    same = pd.Series([True] * 12)
    low, high = limits.over_captures(same, pd.Series(np.repeat(np.arange(6), 2)))
    assert (round(low, 2), high) == (0.61, 1.0)
    assert np.isnan(limits.over_captures(same, pd.Series([0] * 12))).all()


@pytest.mark.parametrize(
    ("found", "planted_one", "strong", "right"),
    [
        ("camera, exposure", "poses", True, True),
        ("exposure, camera", "poses", True, False),
        ("few_views, camera", "poses", True, True),
        ("", "poses", True, False),
        ("", "poses", False, True),
        ("tone", "poses", False, False),
        ("", "nothing", False, True),
        ("exposure", "nothing", False, False),
    ],
)
def test_the_first_advice_is_on_what_is_there(found, planted_one, strong, right):
    row = {"found": found, "faults": planted_one, "strong": strong, "capture": "fox"}
    assert limits.is_advised(row) == right
    assert limits.is_advised(row | {"own": "exposure", "found": "exposure"})


@pytest.mark.parametrize(
    ("stops_ev", "soft", "own"),
    [
        (0.05, (), ""),
        (0.3, (), "exposure"),
        (0.05, (2,), "blurred"),
        (0.3, (0, 3), "exposure blurred"),
    ],
)
def test_a_capture_s_own_faults_are_told_by_its_keypoints(rng, stops_ev, soft, own):
    picture = judged_cases.picture(7, (160, 120))
    names = [f"v{i}" for i in range(6)]
    stops = stops_ev * np.array([-1, 1, -1, 1, -1, 1])
    photos = {
        name: faults.brighter(picture, ev)
        for name, ev in zip(names, stops, strict=True)
    }
    for i in soft:
        photos[names[i]] = cv2.GaussianBlur(photos[names[i]], (0, 0), 2)
    keypoints = rng.uniform(0, (160, 120), (80, 2))
    pairs = np.array([(i, i + 1) for i in range(5)])
    found = matches.Matches(
        names=names,
        width=160,
        height=120,
        keypoints=[keypoints] * 6,
        pairs=pairs,
        indices=[np.tile(np.arange(80)[:, None], (1, 2))] * 5,
        draws=[np.zeros(80)] * 6,
    )
    assert limits.own_of(found, photos) == own


def test_a_cost_is_fitted_by_size_and_ranges_by_captures_that_are_left_out():
    """Each capture suffers in its own measure; what one has twice does not fall."""
    rows = [
        {"cause": "c", "capture": f"c{i}", "size": size, "cost_db": factor * size}
        for i, factor in enumerate((0.5, 1.0, 1.0, 1.0, 1.5))
        for size in (1.0, 2.0, 4.0)
    ]
    fit = limits.stakes(pd.DataFrame(rows))["c"]
    assert fit["sizes"] == pytest.approx([1.0, 2.0, 4.0])
    assert fit["db"] == pytest.approx([1.0, 2.0, 4.0])
    assert 0.4 < fit["low"] < 0.6
    assert 1.5 < fit["high"] < 1.8
    low, middle, high = at_stake.of_fit(fit, 3.0)
    assert (low < middle < high, middle) == (True, pytest.approx(3.0))
    assert at_stake.of_fit(fit, 0.0) == (0, 0, 0)
    # Of what is larger than all that were planted, no more is claimed.
    assert at_stake.of_fit(fit, 40.0)[1] == pytest.approx(4.0)
    # A few cases, or those of a few captures, tell nothing.
    assert limits.stakes(pd.DataFrame(rows[:4])) == {}
    assert limits.stakes(pd.DataFrame(rows[:9])) == {}
