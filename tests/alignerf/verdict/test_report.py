"""The verdict as one object: its state, what to do first, gauges, terminal."""

import itertools
import math
import re
from operator import itemgetter

import pandas as pd
import pytest

from alignerf import causes, testsets
from alignerf.causes import (
    base,
    camera,
    coverage,
    exposure,
    motion,
)
from alignerf.causes.shared import at_stake, remedies
from alignerf.io import provenance
from alignerf.metrics import pairs
from alignerf.verdict import measured, report, views
from tests.alignerf.causes import cases
from tests.alignerf.causes.cases import (
    APART,
    FAULTS,
    GAIN,
    JUDGED,
    THEIRS,
    THUMBNAIL,
    TOGETHER,
    WELL,
)
from tools.bench import limits

EXPORT = "make export SCENE=mine"
ANEW = f"{camera.ANEW}, copied into a folder of their own."
NO_FLOW = {"flow_train_px": math.nan, "flow_test_px": math.nan}


@pytest.fixture(autouse=True)
def export(monkeypatch):
    monkeypatch.setenv(provenance.EXPORT, EXPORT)


def of(e, gains=()):
    return report.of(e._replace(tried=tuple(gains)), [])


def advised(e, gains=()):
    e = e._replace(tried=tuple(gains))
    return report.advise(e, causes.find(e))


@pytest.mark.parametrize(
    ("changes", "state", "px"),
    [
        ({}, "aligned", "0.50 px"),
        ({"overfit_px": 0.45, "flow_train_px": 0.42}, "aligned", "0.90 px"),
        (FAULTS["camera"], "misaligned", "2.4 px"),
        (FAULTS["sparse"], "unclear", ""),
        (FAULTS["sparse"] | {"reprojection_px": 1.7}, "unclear", ""),
        (FAULTS["camera"] | {"epochs": 0.1}, "unclear", ""),
        ({"train_views": 5}, "unclear", ""),
        (NO_FLOW, "unclear", ""),
        # 300 photos of 12 megapixels, trained at 268 px of width.
        (THUMBNAIL, "unclear", "3.8 px"),
        (THUMBNAIL | {"crops": TOGETHER}, "aligned", "0.50 px"),
        # One capture has one verdict at every size of training.
        *(
            ({"crops": APART, "photo_px": photo_px}, "misaligned", "0.68 px")
            for photo_px in (2.0, 4.0, 8.0)
        ),
        # What crops are sure of comes first.
        ({"crops": APART} | FAULTS["sparse"], "misaligned", "0.68 px"),
        ({"crops": APART} | FAULTS["few_views"], "misaligned", "0.68 px"),
        ({"crops": APART, "epochs": 0.1}, "misaligned", "0.68 px"),
        ({"crops": TOGETHER, "epochs": 0.1}, "aligned", "0.50 px"),
        ({"crops": TOGETHER, "flow_train_px": 0.3}, "aligned", "0.50 px"),
        ({"crops": TOGETHER, "flow_train_px": 0.6}, "misaligned", "1.2 px"),
        # Held-out photos do not confirm it.
        (
            {"crops": APART._replace(flow_px=0.9, flow_test_px=1.2)},
            "unclear",
            "0.90 px",
        ),
        # One photo to judge by confirms nothing; without flow nothing is said.
        ({"crops": APART._replace(test_photos=1)}, "aligned", "0.50 px"),
        ({"crops": APART._replace(flow_px=math.nan)}, "aligned", "0.50 px"),
        # As of castle: training photos fit, also where cameras are off.
        (
            {"crops": APART._replace(flow_px=0.12, flow_test_px=1.8)} | THUMBNAIL,
            "unclear",
            "3.8 px",
        ),
    ],
)
def test_the_state_and_the_length_in_the_headline(changes, state, px):
    told = of(WELL._replace(**changes))
    assert told["state"] == state
    assert px in told["headline"]
    assert "nan" not in " ".join(report.terminal(told))


@pytest.mark.parametrize("e", [WELL, THEIRS])
@pytest.mark.parametrize("cause", FAULTS)
def test_each_cause_is_in_headline_gauges_and_advice(e, cause):
    e = cases.with_faults(cause, e=e)
    told, found = of(e), causes.find(e)
    (finding,) = found or [None]
    if finding is None:
        # Of another program's renders, held-out ones may be few.
        assert e.judged
        assert cause in ("few_views", "unregistered", "undertrained")
        return
    levels = {one["cause"]: one["level"] for one in told["causes"]}
    if cause in levels:
        assert levels.pop(cause) == "faulty"
    assert not {"faulty", "likely"} & {*levels.values()}
    if wanted := finding.told(external=bool(e.judged)):
        said = report.advise(e, found)
        assert said == (wanted.format(export=EXPORT) if e.judged else wanted)
        # There were no trainings of ours.
        assert not (e.judged and "align:" in said)


@pytest.mark.parametrize("cause", FAULTS)
def test_a_gauge_is_beyond_its_limit_where_its_cause_is_named(cause):
    for one in of(cases.with_faults(cause))["causes"]:
        beyond = one["value"] > one["limit"]
        if one["more_is_better"]:
            beyond = one["value"] < one["limit"]
        # Test views have a rule of their own.
        if one["cause"] != "few_views" and one["level"] != "cannot tell":
            assert beyond == (one["cause"] == cause), one


def test_levels_of_what_is_not_named():
    """What a short training or an unknown number does not tell is not called fine."""

    def levels(e, level):
        found = [one for one in of(e)["causes"] if one["level"] == level]
        # Each has a reason, which terminal and page show.
        assert all(map(itemgetter("note"), found)) or level != "cannot tell"
        return {one["cause"] for one in found}

    of_matches = {"focal", "rolling_shutter"}
    assert levels(WELL, "ok") == {*FAULTS} - of_matches
    asked = WELL._replace(matches=cases.MATCHES)
    assert levels(asked, "ok") == {*FAULTS}
    (untold,) = [
        one
        for one in of(cases.with_faults("camera"))["causes"]
        if one["cause"] == "motion"
    ]
    assert untold["level"] == "cannot tell"
    assert "cannot tell, because wrong poses distort the model" in untold["text"]
    assert levels(WELL._replace(epochs=0.1), "cannot tell") == cases.BY_FLOW
    assert levels(WELL._replace(psnr_test_db=math.nan), "cannot tell") == {"sparse"}
    dark = WELL._replace(exposure_ev=math.nan, shared_ev=math.nan)
    assert levels(dark, "cannot tell") == {"exposure"}
    said = " ".join(" ".join(report.terminal(of(dark))).split())
    assert "exposure: cannot tell, because photos and renders are black, or" in said
    lines = report.terminal(of(WELL._replace(epochs=0.1)))
    assert [line[:11] for line in lines].count("CANNOT TELL") == 1
    # A shift beyond its limit that the views do not agree on.
    unsure = of(WELL._replace(shift_px=0.11, shift_errors=1.0))["causes"]
    (one,) = [one for one in unsure if one["cause"] == "lens_shift"]
    assert (one["level"], one["value"]) == ("cannot tell", 0.22)
    assert "0.22 \u00b1 0.66 px: not different from 0" in one["text"]


def test_crops_are_the_gauge_where_they_tell():
    told = of(WELL._replace(crops=APART))["causes"]
    (poses,) = [one for one in told if one["cause"] == "camera"]
    assert (poses["value"], poses["limit"]) == (0.68, 0.5)


@pytest.mark.parametrize("moved", [None, 5, 0])
def test_crops_by_cameras_that_did_not_move_are_not_told(moved):
    crops = APART._replace(corrected_px=0.31)
    gain = GAIN._replace(cameras_moved=moved)
    told = of(WELL._replace(crops=crops), [gain])["measured"]
    assert ("0.31 px" in " ".join(told)) == (moved != 0)


def test_what_was_measured_has_its_numbers():
    def said(**changes):
        return " ".join(of(WELL._replace(**changes))["measured"])

    assert "0.72 px (95 % interval 0.60 px to 0.90 px)" in said(crops=APART)
    short = APART._replace(epochs=0.1)
    assert measured.NOTHING_TOLD["short"].format(w=short) in said(crops=short)
    # One floor for what is called aligned and for what can be told.
    assert "under 0.90 px" in said(overfit_px=0.45)
    for depth, words in measured.DEPTHS.items():
        text = said(judged=JUDGED._replace(depth=depth))
        assert words in text
        assert ("given with DEPTH=folder." in text) == (depth != "given")
    before = JUDGED._replace(before=("first", 2.4, None, None))
    assert "in first, it was 2.4 px on" in said(judged=before)
    none = {"test_views": 0, "flow_test_px": math.nan, "psnr_test_db": math.nan}
    assert "No renders of held-out" in said(judged=JUDGED, **none)
    off = {"photo_px": 2.0, "perturb_px": 1.5}
    assert "perturbs the poses by 3.0 px (perturb_px)." in said(**off)
    both = said(**off, perturb_by="both")
    assert "perturbs the poses by 3.0 px (perturb_px, perturb_by: both)." in both


def test_a_comparison_has_more_than_one_score():
    """Of the same held-out views alone; a score that one of both lacks is left out."""
    before = {"views": 6, "width_px": 400, "psnr_db": 20.1, "ssim": 0.64}
    before |= {"sharpness": 0.41}
    now = before | {"psnr_db": 19.0, "ssim": 0.81, "sharpness": 0.78}

    def said(before, now):
        shifts = "first", 2.4, None, before
        judged = JUDGED._replace(before=shifts, scores=now)
        return " ".join(of(WELL._replace(judged=judged))["measured"])

    wanted = "Held-out photos: PSNR (dB) 20.10 -> 19.00, SSIM 0.640 -> 0.810, "
    assert wanted + "sharpness (photo: 1) 0.41 -> 0.78." in said(before, now)
    assert "SSIM" not in said(before, now | {"ssim": math.nan})
    assert "PSNR" in said(before | {"ssim": None}, now)
    for other in (None, now | {"views": 5}, now | {"width_px": 200}):
        assert "Held-out photos: PSNR" not in said(before, other)
        assert "Held-out photos: PSNR" not in said(other, now)


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        (THUMBNAIL, report.UNSEEN),
        (THUMBNAIL | {"crops": APART._replace(epochs=0.1)}, report.LARGER),
        (THUMBNAIL | {"crops": APART._replace(test_photos=3)}, report.WIDER),
        # Poses are known to be off only where a moved camera explains it.
        (
            {"crops": APART._replace(camera_px=0.1)},
            f"{camera.ALIGN} The cause is unknown: look at the residual flow.",
        ),
        (FAULTS["camera"] | {"epochs": math.nan}, camera.OF_OTHERS),
        (
            FAULTS["camera"] | {"poses_given": True},
            f"{ANEW} Or {camera.ALIGN}",
        ),
        # What is known to cost most comes first.
        (
            FAULTS["sparse"] | {"reprojection_px": 1.7},
            coverage.SPARSE.advice,
        ),
        # Bad renders show as probable what photos alone would tell, as of fox by 15.
        (FAULTS["sparse"] | {"exposure_ev": 0.07}, coverage.SPARSE.advice),
        (FAULTS["sparse"] | {"moved_fraction": 0.2}, coverage.SPARSE.advice),
        (FAULTS["sparse"] | FAULTS["blurred"], coverage.SPARSE.advice),
    ],
)
def test_what_to_do_first(changes, wanted):
    assert advised(WELL._replace(**changes)) == wanted


@pytest.mark.parametrize("cause", ["camera", "motion"])
def test_what_is_not_exported_is_not_advised(cause):
    """There is an export only of cameras, and of photos that were learnt from."""
    e = cases.with_faults(cause, e=THEIRS)
    assert EXPORT in advised(e)
    assert EXPORT not in advised(e._replace(judged=JUDGED._replace(cameras="none")))
    assert EXPORT not in advised(e._replace(train_views=0, test_views=14))


def test_held_out_renders_alone_are_enough():
    """As gsplat writes them."""
    e = THEIRS._replace(train_views=0, flow_train_px=math.nan, psnr_train_db=math.nan)
    told = of(e._replace(test_views=14, flow_test_px=1.2, camera_px=1.1))
    assert (told["state"], "2.2 px" in told["headline"]) == ("misaligned", True)


MOTION = WELL._replace(moved_fraction=0.08, test_views=9)
WARPED = remedies.Gain("base", -0.1, -0.2, 0.03, 3.0, warped=True)
LONGER = motion.CAUSE.advice


@pytest.mark.parametrize(
    ("gains", "views", "wanted"),
    [
        ([WARPED._replace(low=0.1, high=0.7)], 9, LONGER),
        ([WARPED], 9, "leave the photos"),
        # A staged training says nothing of warping, and few views nothing at all.
        ([WARPED._replace(warped=False, name="base, warped once")], 9, LONGER),
        ([WARPED], 3, LONGER),
        # Cameras that moved say nothing of photos, and are judged apart.
        ([WARPED._replace(in_loop=True)], 9, "leave cameras and photos"),
    ],
)
def test_photos_that_were_warped_in_vain_are_not_warped_again(gains, views, wanted):
    e = MOTION._replace(test_views=views, tried=tuple(gains))
    found = motion.find(e)._replace(cause=motion.CAUSE)
    assert found.told(external=False).startswith(wanted)


@pytest.mark.parametrize(
    ("changes", "views", "pays", "wanted"),
    [
        (
            {},
            9,
            True,
            f"train on the corrected cameras, which `{EXPORT}` writes.",
        ),
        ({"low": -0.1}, 9, False, "leave cameras and photos as they are"),
        ({"test_set": "standard"}, 9, False, "leave cameras and photos as they are"),
        ({}, 3, False, camera.ALIGN),
        # A warping round is none.
        ({"in_loop": False}, 9, True, camera.ALIGN),
        # What cameras gained that did not move, chance or longer steps did.
        ({"cameras_moved": 0}, 9, True, "leave the cameras as they are: aligned"),
    ],
)
def test_what_to_do_follows_what_this_run_has_tried(changes, views, pays, wanted):
    e, gain = cases.with_faults("camera", test_views=views), GAIN._replace(**changes)
    assert remedies.pays(e, gain) == pays
    assert camera.advise(e._replace(tried=(gain,))).startswith(wanted)
    # What pays is taken before what brought more by chance.
    lucky = gain._replace(method="lucky", db=1.0, low=-0.1, high=2.1)
    tried = e._replace(tried=(lucky, gain))
    assert camera.advise(tried).startswith(wanted) or not pays
    # The same where nothing is wrong, if it pays.
    if pays and gain.in_loop:
        assert advised(WELL._replace(test_views=views), [gain]).startswith(wanted)


def test_given_poses_that_aligning_did_not_help_are_found_anew_alone():
    e = cases.with_faults("camera", poses_given=True)
    assert advised(e, [GAIN._replace(low=-0.1)]) == ANEW
    assert advised(e, [GAIN]).startswith(
        f"{ANEW} Until then train on the corrected cameras"
    )
    command = 'make photos FOLDER=scan/images OPTIONS="--name scan_colmap"'
    e = e._replace(by_colmap=command)
    assert of(e)["do_first"]["command"] == command


def test_matches_come_before_held_out_photos():
    e = cases.with_faults("camera", test_views=3)
    told = {"accepted": True, "halved": True, "worse": False}
    assert remedies.pays(e, GAIN._replace(matches=told))
    worse = {"accepted": False, "halved": False, "worse": True}
    assert not remedies.pays(e._replace(test_views=9), GAIN._replace(matches=worse))
    off = base.Matches(True, False, 1.3, 0.5, 1.5, 4.0)
    assert advised(e._replace(matches=off)) == camera.ADJUSTED


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, ". Corrected: +0.6 dB (0.3 to 0.9)."),
        ({"low": 0.41, "high": 0.79}, ". Corrected: +0.60 dB (0.41 to 0.79)."),
        ({"low": -0.1}, "."),
        ({"in_loop": False}, "."),
    ],
)
def test_the_headline_says_why_it_is_blurry_and_what_correcting_brings(changes, said):
    e = cases.with_faults("camera", test_views=9)
    told = of(e, [GAIN._replace(**changes)])
    assert told["headline"] == f"Blurry because poses are off by 2.4 px{said}"
    assert [one["in_headline"] for one in told["tried"]] == ["Corrected" in said]


def test_where_photos_are_misaligned_the_farthest_off_are_named():
    rows = [view_of(f"v{i}", px) for i, px in enumerate([0.1, math.nan, 3, 2, 1])]
    told = report.of(cases.with_faults("camera"), rows)["measured"]
    assert "Farthest off: v2 (6.0 px), v3 (4.0 px), v4 (2.0 px)." in told
    assert "Farthest" not in " ".join(report.of(WELL, rows)["measured"])


def view_of(name, flow_px):
    numbers = dict.fromkeys(views.COLUMNS, 1.0) | {"split": "train", "stands_out": ""}
    return views.View(**numbers | {"view": name, "flow_px": flow_px})


def test_a_gain_has_its_numbers_and_says_what_it_is_measured_against():
    def said(e=WELL, **changes):
        return report.tried(GAIN._replace(**changes), e)["text"]

    assert "+0.6 dB [+0.3, +0.9]" in said()
    assert "+0.60 dB [+0.40, +0.80]" in said(low=0.4, high=0.8)
    for one in testsets.every():
        assert one.against in said(test_set=one.name)
    # Of another program no view can be asked for by another camera.
    for moved in (True, False):
        text = said(test_set="standard", in_loop=moved)
        assert ("true gain is larger" in text) == moved
    for low, by_chance in ((0.3, False), (-0.1, True), (math.nan, True)):
        text = said(low=low)
        assert ("not significant" in text) == by_chance
        # From few views it claims nothing.
        assert "significant" not in said(WELL._replace(test_views=3), low=low)
    for count in (None, 5, 0):
        assert ("no camera moved" in said(cameras_moved=count)) == (count == 0)


def test_a_command_stands_on_a_line_of_its_own_and_lines_fit_a_terminal():
    told = of(cases.with_faults("camera"), [GAIN])
    assert told["do_first"]["command"] == EXPORT
    assert told["tried"][0]["pays"]
    lines = report.terminal(told)
    place = [line[:8] for line in lines].index("DO FIRST")
    assert " " * 17 + EXPORT in lines[place + 1 : place + 3]
    assert "`" not in "".join(lines)
    assert max(map(len, lines)) <= report.WIDTH
    titles = [line[: report.INDENT].strip() for line in lines]
    parts = ["VERDICT", "DO FIRST", "TRIED", "MEASURED", "OK", "CANNOT TELL"]
    assert list(filter(None, titles)) == parts


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0"), (0.123, "0.12"), (4, "4"), (0.045, "0.045"), (12.3, "12")],
)
def test_numbers_have_two_digits(value, text):
    assert base.number(value) == text
    assert base.number(math.nan) == base.length(math.nan) == "unknown"


def test_photos_that_are_too_few_are_not_called_aligned():
    """Also where another cause explains why held-out photos are worse."""
    e = THEIRS._replace(**FAULTS["sparse"], tone_gain_ev=0.6)
    told = of(e)
    assert told["state"] == "unclear"
    assert "held-out photos are far worse" in told["headline"]


def test_what_is_sure_is_cured_before_what_is_probable():
    """A splat of fox with wrong poses was advised to fix its exposure."""
    both = FAULTS["camera"] | {"exposure_ev": 1.9 * exposure.EXPOSURE_EV}
    accepted = base.Matches(True, False, 2.0, 0.5, 3.0, 6.0)
    e = WELL._replace(**both, matches=accepted)
    levels_of = {one.cause.name: one.sure for one in causes.find(e)}
    assert levels_of == {"camera": True}
    assert "exposure" not in advised(e)
    surely = e._replace(exposure_ev=3 * exposure.EXPOSURE_EV)
    assert {*cases.named(surely)} == {"camera", "exposure"}
    # What points share says nothing beside poses that blur it.
    shared = e._replace(exposure_ev=0.0, shared_ev=3 * exposure.SHARED_EV)
    assert "exposure" not in cases.named(shared)
    # A film that is too sparse, as renders.
    film = THEIRS._replace(**FAULTS["sparse"], shared_ev=1.01 * exposure.SHARED_EV)
    assert cases.named(film) == ["sparse", "exposure"]
    assert advised(film) == coverage.SPARSE.advice


def test_what_costs_most_comes_first_with_its_advice():
    """Half a stop between photos of a phone whose lens is off by 5 px, too."""
    bend = cases.FINE._replace(
        changed=["distortion"], distortion_px=4.9, before_px=0.6, after_px=0.3
    )
    matches = cases.MATCHES._replace(before_px=0.6, after_px=0.58, lens=bend)
    e = THEIRS._replace(matches=matches, exposure_ev=0.5, hidden_views=3)
    told = of(e)
    # A model hangs what it cannot explain by brightness before the cameras.
    assert cases.named(e) == ["exposure", "lens_distortion"]
    assert told["do_first"]["text"].startswith("Lock the exposure")
    stakes = [one["at_stake_db"] for one in told["findings"]]
    assert stakes[0][0] > stakes[1][0]
    assert re.search(r"At stake: about \d+ to \d+ dB\.$", told["because"][0])


def test_two_renders_that_are_exchanged_are_what_is_advised_on():
    swapped = {name: ("swapped", f"shows {name}") for name in ("a", "b")}
    told = of(THEIRS._replace(pairs=pairs.Checked(48, swapped)))
    assert told["findings"][0]["cause"] == "pairs"
    assert told["do_first"]["text"].lower() == pairs.ADVICE["swapped"].lower()


@pytest.mark.parametrize(
    ("stake", "said"),
    [
        (None, "unknown"),
        ((0.01, 0.1, 0.29), "under 0.3 dB"),
        ((0.02, 0.2, 0.8), "up to about 0.8 dB"),
        ((0.44, 0.6, 1.21), "about 0.4 to 1.2 dB"),
        ((1.21, 1.22, 1.23), "about 1.2 dB"),
        ((2.2, 3.0, 5.6), "about 2 to 6 dB"),
        ((0.3, 3.0, 5.6), "up to about 6 dB"),
    ],
)
def test_what_is_at_stake_has_no_more_digits_than_its_range_allows(stake, said):
    found = base.Finding(1.0, 0.5, True, at_stake=stake)
    assert at_stake.said(found) == f"At stake: {said}."


def generated(rng):
    """Evidences with some numbers that are far from any scene's, or no numbers."""
    numbers = [key for key, one in WELL._asdict().items() if isinstance(one, float)]
    numbers = [key for key in numbers if not key.startswith("photo_")]
    counts = ["train_views", "test_views", "registered", "copies"]
    lenses = [*itertools.product(("focal", "centre", "distortion", "shutter"), (2, 9))]
    values = [math.nan, -1.0, 0.0, 0.2, 0.6, 3.0, 40.0, 1e9]
    for _ in range(3000):
        e = [WELL, THEIRS][rng.integers(2)]
        chosen = rng.choice(numbers, 5)
        changes = dict(zip(chosen, map(float, rng.choice(values, 5)), strict=True))
        if "tone_gain_ev" in changes:
            # No two levels of 8 bits are further apart.
            changes["tone_gain_ev"] = min(changes["tone_gain_ev"], 8.0)
        changes |= {rng.choice(counts): int(rng.choice([0, 1, 4, 40, 10**9]))}
        if rng.random() < 0.3:
            changes["octaves"] = tuple(map(float, rng.choice(values, 5)))
        if rng.random() < 0.3:
            part, px = lenses[rng.integers(len(lenses))]
            more = {"focal": {"focal_ratio": 1.02}}.get(part, {f"{part}_px": px})
            changes["matches"] = cases.with_lens(part, **more)._replace(
                before_px=float(rng.choice(values)), accepted=bool(rng.integers(2))
            )
        if rng.random() < 0.2:
            wrong = {f"v{i}": ("swapped", "") for i in range(rng.integers(1, 9))}
            changes["pairs"] = pairs.Checked(48, wrong)
        if rng.random() < 0.2:
            changes["crops"] = APART._replace(flow_px=float(rng.choice(values)))
        gains = [WARPED, WARPED._replace(in_loop=True), GAIN]
        changes["tried"] = tuple(
            gains[i] for i in rng.integers(3, size=rng.integers(3))
        )
        yield e._replace(**changes)


def test_the_first_cause_has_most_at_stake_and_its_advice_is_what_to_do(rng):
    """Of all planted cases, and of whatever else may be measured."""
    for e in [*planted(), *generated(rng)]:
        told, named = of(e, e.tried), causes.find(e)
        findings = told["findings"]
        assert [one["cause"] for one in findings] == [
            one["cause"] for one in told["causes"] if one["level"] in report.LEVELS[:2]
        ]
        places = [
            (one.sure, one.at_stake is not None, (one.at_stake or (0, 0))[1])
            for one in named
        ]
        assert places == sorted(places, reverse=True)
        text = told["do_first"]["text"]
        if named:
            first = named[0].told(external=bool(e.judged))
            wanted = report.with_export(e, first) if e.judged else first
            assert text == wanted[0].upper() + wanted[1:]
            assert "othing about alignment" not in text
        for one in told["causes"]:
            # Nothing beyond its limit is called fine.
            found = base.beyond(
                one["value"], one["limit"], more_is_better=one["more_is_better"]
            )
            assert (one["level"], found.sure is not None) != (report.OK, True), one
        counts = tuple(one.called for one in report.COUNTS)
        head = told["headline"].removeprefix("Blurry because ")
        others = {one.cause for one in named} - {*report.COUNTS}
        assert not (
            told["state"] == "misaligned" and others and head.startswith(counts)
        )
        for one in findings:
            assert all(map(math.isfinite, one["at_stake_db"] or ()))
        said = " ".join([*report.terminal(told), text, *told["because"]])
        assert not {"nan", "inf", "None"} & {*re.findall(r"[A-Za-z]+", said)}, said
        assert not re.search(r"{\w+}", said)
        assert len(told["because"]) == (0 if e.pairs.stops else len(named))


def planted():
    """The evidence of all planted cases."""
    table = pd.read_csv("tests/alignerf/causes/planted.csv", comment="#")
    rows = table[table["refused"].isna()].to_dict("records")
    return map(limits.evidence_of, rows)


@pytest.mark.parametrize(
    ("cause", "e"),
    [
        *((cause, WELL) for cause in ("transients", "motion", "blurred", "copies")),
        ("floaters", THEIRS._replace(**cases.OF_RENDERS["floaters"])),
    ],
)
def test_the_first_few_photos_are_named_in_texts_and_all_in_the_file(cause, e):
    names = tuple(f"IMG_{i}" for i in range(9))
    e = e._replace(**FAULTS.get(cause, {}))
    for count in (0, 1, 5, 9):
        told = of(e._replace(photos={cause: names[:count]}))
        (one,) = told["findings"]
        assert (one["cause"], one["photos"]) == (cause, names[:count])
        (said,) = told["because"]
        assert sum(name in said for name in names) == min(count, base.MAX_NAMED)
        assert ("and 4 more" in said) == (count == 9)
        assert said.count("(") == (count > 0)


def test_what_comes_and_goes_is_no_lens_and_no_floater():
    """Something on a tenth of every second photo of fern, which has its own lens."""
    flows = {"distortion_px": 0.8, "distortion_errors": 9.0, "moved_fraction": 0.2}
    flows |= {"hidden_views": 9, "exposure_ev": 0.1}
    e = THEIRS._replace(**flows, transient_fraction=0.04)
    assert [one.cause.name for one in causes.find(e)] == ["transients"]
    assert [one.sure for one in causes.find(e)] == [True]
    # What is only probable spoils nothing, nor does what wrong poses make.
    e = e._replace(transient_fraction=0.005)
    assert {"transients", "floaters"} < {one.cause.name for one in causes.find(e)}
    wrong = cases.with_lens("focal", focal_ratio=1.02)._replace(lens=None)
    e = WELL._replace(matches=wrong, transient_fraction=0.006)
    assert "transients" not in {one.cause.name for one in causes.find(e)}
    assert not [one for one in causes.find(WELL._replace(transient_fraction=math.nan))]
