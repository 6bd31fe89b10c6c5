"""The verdict's decision: each cause alone and in pairs, none where all is well."""

import math

import pandas as pd
import pytest

from alignerf import poses
from alignerf.verdict import advice, causes, remedies, report, shift, windows, words

# A scene in which nothing is wrong, as measured on courtyard.
WELL = causes.Evidence(
    train_views=42,
    test_views=6,
    registered=48,
    total=48,
    photo_px=2.0,
    reprojection_px=0.2,
    flow_train_px=0.07,
    flow_test_px=0.09,
    camera_px=0.06,
    remainder_px=0.03,
    moved_share=0.0,
    psnr_train_db=28.7,
    psnr_test_db=27.2,
    overfit_px=0.09,
    passes=0.8,
    detail_median=1.2,
    blurred_share=0.0,
    exposure_ev=0.005,
    shared_ev=0.04,
    shift_px=0.02,
    shift_errors=4.1,
    distortion_px=0.02,
    distortion_errors=1.3,
    photo_width_px=400.0,
)
FAULTS = {
    "camera": {"flow_train_px": 1.2, "camera_px": 1.2},
    "motion": {"moved_share": 0.08},
    "sparse": {"flow_test_px": 2.0, "psnr_test_db": 17.0},
    "few_views": {"test_views": 2},
    "lens_shift": {"shift_px": 0.5, "shift_errors": 20.0},
    "lens_distortion": {"distortion_px": 0.8, "distortion_errors": 9.0},
    "blurred": {"blurred_share": 0.2},
    "exposure": {"exposure_ev": 0.2},
    "undertrained": {"passes": 0.4},
    "unregistered": {"registered": 20, "total": 45},
}


def report_of(e, findings, gains, views):
    """The report's sentences in a row, its headline first and what to do last."""
    found = report.of(e, findings, gains, views)
    lines = [*found.because, *found.measured, *(one["text"] for one in found.tried)]
    return [f"Verdict: {found.headline}", *lines, f"To do: {found.do_first['text']}"]


def named(**changes):
    return [finding.cause for finding in causes.find(WELL._replace(**changes))]


def test_a_slow_drift_of_exposure_is_named_where_depth_can_be_trusted():
    assert named(shared_ev=0.3) == ["exposure"]
    assert named(shared_ev=0.1) == []
    assert named(shared_ev=math.nan) == []
    assert "exposure" not in named(shared_ev=0.3, passes=0.1)
    (found,) = causes.find(WELL._replace(shared_ev=0.3, exposure_ev=0.07))
    assert found.size == 0.3
    assert not found.sure


def test_nothing_is_named_where_nothing_is_wrong():
    assert causes.find(WELL) == []
    assert not shift.misaligned(WELL)


@pytest.mark.parametrize("cause", FAULTS)
def test_each_cause_is_named_alone(cause):
    assert named(**FAULTS[cause]) == [cause]


@pytest.mark.parametrize("first", FAULTS)
@pytest.mark.parametrize("second", FAULTS)
def test_two_causes_are_both_named(first, second):
    assert set(named(**FAULTS[first] | FAULTS[second])) == {first, second}


def test_a_shift_within_its_error_is_none():
    assert named(shift_px=0.5, shift_errors=2.0) == []
    assert named(shift_px=0.5, shift_errors=math.nan) == []


def test_more_flow_on_test_views_alone_is_not_misalignment():
    """The case that a rule on test flow would have sent to be warped."""
    found = WELL._replace(flow_test_px=2.0, psnr_test_db=17.0, camera_px=1.65)
    assert [finding.cause for finding in causes.find(found)] == ["sparse"]
    assert "too few photos" in words.headline(found, causes.find(found))


@pytest.mark.parametrize(
    ("changes", "causes_named"),
    [
        # Renders of the training views fit, and the points say what they hide.
        ({"reprojection_px": 1.3}, ["sparse", "camera"]),
        ({"reprojection_px": 0.7}, ["sparse"]),
        ({"reprojection_px": math.nan}, ["sparse"]),
        # Where photos suffice, the flow tells.
        ({"reprojection_px": 1.3, "flow_test_px": 0.09, "psnr_test_db": 27.2}, []),
    ],
)
def test_from_too_few_photos_points_tell_of_poses(changes, causes_named):
    assert named(**FAULTS["sparse"] | changes) == causes_named


def test_without_training_renders_test_views_tell():
    nothing = WELL._replace(flow_train_px=math.nan, psnr_train_db=math.nan)
    assert causes.find(nothing) == []
    apart = nothing._replace(flow_test_px=1.0, camera_px=0.9)
    assert [finding.cause for finding in causes.find(apart)] == ["camera"]


@pytest.mark.parametrize("cause", [*FAULTS, None])
def test_the_words_have_the_numbers_and_one_thing_to_do(cause):
    known = WELL._replace(**FAULTS.get(cause, {}))
    lines = report_of(known, causes.find(known), [], [])
    assert lines[0].startswith("Verdict: ")
    assert lines[-1].startswith("To do: ")
    assert "nan" not in " ".join(lines).lower()
    assert "ligned" in lines[0] or "oo few" in lines[0]
    if cause == "camera":
        assert lines[0] == "Verdict: Misaligned by 2.4 px: poses are off."
        assert "a moved camera explains 2.4 px of the shift" in " ".join(lines)
    if cause is None:
        assert lines[0] == "Verdict: Aligned, as far as 0.50 px can show."


def test_the_words_say_what_points_told():
    known = WELL._replace(**FAULTS["sparse"], reprojection_px=1.7)
    lines = report_of(known, causes.find(known), [], [])
    assert lines[0].startswith("Verdict: Poses are off, and photos are too few")
    told = "Poses are off: points that several photos show lie 3.4 px from"
    assert any(line.startswith(told) for line in lines)
    # What can be done at the desk comes first.
    assert lines[-1].startswith("To do: Align on the way")
    assert lines[-1].endswith("And take more photos between those you have.")


def warped(*db, **changes):
    """A remedy that warped photos, whatever its name."""
    return remedies.Gain("base", *db, 3.0, warped=True)._replace(**changes)


@pytest.mark.parametrize(
    ("gains", "views", "said"),
    [
        ([], 9, "train longer, then warp the photos once"),
        ([warped(0.4, 0.1, 0.7)], 9, "train longer, then warp"),
        ([warped(-0.1, -0.2, 0.03)], 9, "leave the photos"),
        # A staged training says nothing of warping, and few views nothing at all.
        ([warped(-1.1, -1.4, -0.9, warped=False)], 9, "train longer, then warp"),
        (
            [warped(-1.1, -1.4, -0.9, name="base, warped once", warped=False)],
            *(9, "train longer, then warp"),
        ),
        ([warped(-0.1, -0.2, 0.03)], 2, "train longer, then warp"),
        # Cameras that moved say nothing of photos, and are judged apart.
        ([warped(-0.1, -0.2, 0.03, on_the_way=True)], 9, "leave cameras and photos"),
    ],
)
def test_what_was_tried_in_vain_is_not_recommended(gains, views, said):
    known = WELL._replace(moved_share=0.03, test_views=views)
    found = [causes.Finding("motion", 0.03, False)]
    assert advice.advise(known, found, gains).startswith(said)


def gain(**changes):
    found = remedies.Gain("aligned", 0.6, 0.3, 0.9, 4.0, "aligned", True)
    return found._replace(**changes)


@pytest.mark.parametrize(
    ("changes", "views", "said", "pays"),
    [
        ({}, 9, "take the cameras of aligned, which this run has put right", True),
        ({"low": -0.1}, 9, "leave cameras and photos as given", False),
        ({"test_set": "standard"}, 9, "leave cameras and photos as given", False),
        # A warping round is none.
        ({"on_the_way": False}, 9, "align on the way", True),
    ],
)
def test_what_to_do_follows_what_this_run_has_tried(changes, views, said, pays):
    known = WELL._replace(**FAULTS["camera"] | {"test_views": views})
    tried = gain(**changes)
    assert advice.advise(known, causes.find(known), [tried]).startswith(said)
    assert advice.pays(known, tried) == pays


def test_of_few_crossfit_photos_nothing_pays():
    known = WELL._replace(**FAULTS["camera"] | {"test_views": 3})
    assert not advice.pays(known, gain())
    assert advice.of_tried(known, [gain()]) == ""


def test_what_pays_is_taken_before_what_brought_more_by_chance():
    known = WELL._replace(**FAULTS["camera"])
    lucky = gain(method="lucky", db=1.0, low=-0.1, high=2.1)
    said = advice.advise(known, causes.find(known), [lucky, gain()])
    assert "cameras of aligned" in said


def test_no_cameras_are_offered_where_none_was_moved():
    """What they gained, chance or longer steps did."""
    still = gain(cameras_moved=0)
    for findings in ([], causes.find(WELL._replace(flow_train_px=1.2, camera_px=1.2))):
        said = advice.advise(WELL, findings, [still])
        assert "put right" not in said
        assert "looked at them, and moved none" in said
    assert "without moving a camera" in remedies.line(still, WELL)
    for moved in (None, 5):
        line = remedies.line(gain(cameras_moved=moved), WELL)
        assert "without" not in line


def test_what_is_promised_is_what_was_measured(root):
    measured = root / "docs/measured"
    rows = pd.read_csv(measured / "remedies.csv", comment="#")
    gain = rows.set_index(["condition", "budget", "remedy"])["gain_db"]
    warped = "photos warped once, from scratch"
    both, motion = "poses wrong, objects move", "objects move"
    rows = pd.read_csv(measured / "on_the_way.csv", comment="#")
    equal = rows.set_index(["scene", "share", "method"])["equal_db"]
    assert round(equal[both, 1, "aligned on the way"], 1) == advice.ALIGNED_DB
    assert round(equal[both, 2, "aligned on the way"], 1) == advice.ALIGNED_TWICE_DB
    assert round(gain[motion, 2, warped], 1) == advice.WARPED_MOTION_TWICE_DB
    steps = pd.read_csv(measured / "remedies_steps.csv", comment="#")
    gain = steps.set_index(["condition", "remedy"])["gain_db"]
    assert round(gain[motion, warped], 1) == advice.WARPED_MOTION_DB
    sweep = pd.read_csv(measured / "tradeoff.csv", comment="#").set_index("setting")
    assert round(sweep.loc["4000 steps", "difference_db"], 1) == advice.LONGER_DB


def test_what_the_poses_warn_of_is_what_the_verdict_says():
    assert poses.FEW_TRAIN_VIEWS == shift.FEW_TRAIN_VIEWS
    assert poses.FEW_TEST_VIEWS == shift.FEW_TEST_VIEWS


def test_after_too_short_a_training_nothing_of_alignment_is_told():
    known = WELL._replace(**FAULTS["camera"] | {"passes": 0.1})
    found = causes.find(known)
    assert [finding.cause for finding in found] == ["undertrained"]
    assert "too short to tell" in words.headline(known, found)
    assert advice.advise(known, found).startswith("train longer")


# Windows of a capture whose poses are wrong, at the photos' own size.
APART = windows.Windows(
    places=2,
    px=160,
    photos=18,
    test_photos=6,
    flow_px=0.72,
    low_px=0.6,
    high_px=0.9,
    flow_test_px=1.64,
    camera_px=0.68,
    remainder_px=0.17,
    passes=1.1,
)
TOGETHER = APART._replace(
    flow_px=0.2, low_px=0.15, high_px=0.25, flow_test_px=0.4, camera_px=0.1
)


def test_windows_decide_in_pixels_of_the_photo():
    known = WELL._replace(windows=APART, photo_width_px=1920.0)
    found = causes.find(known)
    assert [(one.cause, one.sure) for one in found] == [("camera", True)]
    lines = report_of(known, found, [], [])
    assert lines[0] == "Verdict: Misaligned by 0.72 px: poses are off."
    told = "At the photos' own size a photo and its render are shifted by 0.72 px (95 %"
    assert any(line.startswith(told) for line in lines)
    assert any("which is 0.60 px at 1600 px of width" in line for line in lines)
    assert words.state(known, found) == "misaligned"
    well = known._replace(windows=TOGETHER)
    assert causes.find(well) == []
    limit = words.length(shift.WINDOW_PX)
    said = f"aligned, as far as {limit} can show."
    assert words.headline(well, []) == said


def test_one_capture_has_one_verdict_at_every_size_of_training():
    """The words on alignment are those of the windows, whatever the training's size."""
    said = set()
    for photo_px in (2.0, 4.0, 8.0):
        known = WELL._replace(photo_px=photo_px, windows=APART, photo_width_px=1920.0)
        said.add(words.headline(known, causes.find(known)))
    assert len(said) == 1


@pytest.mark.parametrize("changes", [{}, FAULTS["sparse"], FAULTS["few_views"]])
def test_what_windows_are_sure_of_is_the_headline(changes):
    """Few photos are a caution beside it; the advice is what the desk can cure."""
    known = WELL._replace(windows=APART, photo_width_px=1920.0, **changes)
    found = causes.find(known)
    assert words.headline(known, found).startswith("misaligned by 0.72 px")
    assert "poses are off" in words.headline(known, found)
    assert "align on the way" in advice.advise(known, found)


def test_windows_that_were_trained_too_short_tell_nothing():
    known = WELL._replace(windows=APART._replace(passes=0.1))
    assert causes.find(known) == []
    said = "tell nothing: each of their pixels was seen 0.1 times"
    assert said in " ".join(report_of(known, [], [], []))


def test_a_thumbnail_is_not_called_aligned():
    """300 photos of 12 megapixels, trained at 268 px of width."""
    known = WELL._replace(photo_px=15.0, photo_width_px=4000.0)
    head = words.headline(known, causes.find(known))
    said = "cannot be told at this size: a shift under 3.8 px would not be"
    assert head.startswith(said)
    assert words.state(known, []) == "unclear"
    assert words.state(known._replace(windows=TOGETHER), []) == "aligned"


def test_given_poses_are_first_found_anew():
    known = WELL._replace(**FAULTS["camera"], poses_given=True)
    said = advice.advise(known, causes.find(known))
    assert said.startswith("let COLMAP find the poses anew, from a folder")
    command = report.first(said)["command"]
    assert command == 'make photos FOLDER=photos_alone PHOTOS="--name another"'
    assert "Or align on the way" in said


def test_an_error_that_was_put_in_explains_a_good_reprojection_error():
    known = WELL._replace(**FAULTS["camera"], perturb_px=1.5)
    lines = report_of(known, causes.find(known), [], [])
    assert any(
        "An error of 3.0 px was put in on purpose (perturb_px)" in line
        for line in lines
    )


def test_heading_and_sentence_are_equally_sure():
    for share, adverb in ((0.06, "probably "), (0.2, "")):
        known = WELL._replace(moved_share=share)
        lines = report_of(known, causes.find(known), [], [])
        assert f"the scene {adverb}moved" in lines[0]
        assert any(f"The scene {adverb}moved" in line for line in lines[1:])


def test_one_floor_for_what_is_called_aligned_and_what_can_be_told():
    known = WELL._replace(overfit_px=0.45, flow_train_px=0.42)
    assert not shift.misaligned(known)
    lines = report_of(known, causes.find(known), [], [])
    assert "as far as 0.90 px can show" in lines[0]
    assert any("under 0.90 px" in line for line in lines)


def test_windows_whose_geometry_nothing_fixes_tell_nothing():
    """As of castle: training photos fit, also where cameras are off."""
    sparse = APART._replace(flow_px=0.12, flow_test_px=1.8)
    known = WELL._replace(windows=sparse, photo_px=15.0, photo_width_px=4000.0)
    assert words.state(known, causes.find(known)) == "unclear"
    lines = report_of(known, causes.find(known), [], [])
    said = "own size tell nothing: photos that were trained on are 0.12 px apart"
    assert any(said in line for line in lines)


NOT_CONFIRMED = APART._replace(flow_px=0.9, flow_test_px=1.2)


@pytest.mark.parametrize(
    ("changes", "state", "head"),
    [
        # The same windows, whatever the small training says beside them.
        ({"windows": TOGETHER, "flow_train_px": 0.3}, "aligned", "aligned, as far as"),
        (
            {"windows": TOGETHER, "flow_train_px": 0.6},
            "misaligned",
            "misaligned by 1.2",
        ),
        ({"windows": TOGETHER, "passes": 0.1}, "aligned", "aligned, as far as 0.50 px"),
        ({"windows": APART, "passes": 0.1}, "misaligned", "misaligned by 0.72 px"),
        ({"windows": NOT_CONFIRMED}, "unclear", "cannot be told for sure: windows are"),
        # One photo to judge by confirms nothing.
        ({"windows": APART._replace(test_photos=1)}, "aligned", "aligned, as far as"),
        ({"windows": APART._replace(flow_px=math.nan)}, "aligned", "aligned, as far"),
        (
            {"flow_train_px": math.nan, "flow_test_px": math.nan},
            "unclear",
            "cannot be told: no flow from renders to photos is valid",
        ),
    ],
)
def test_what_windows_and_whole_photos_come_to(changes, state, head):
    known = WELL._replace(**changes)
    found = causes.find(known)
    assert words.state(known, found) == state
    assert words.headline(known, found).startswith(head)


def test_the_camera_part_is_of_what_the_headline_is_of():
    known = WELL._replace(windows=APART, flow_train_px=1.2, camera_px=1.1)
    lines = report_of(known, causes.find(known), [], [])
    assert "by 0.72 px" in lines[0]
    assert "in the windows a moved camera explains 0.68 px" in lines[1]
    other = APART._replace(camera_px=0.1, remainder_px=0.6)
    known = WELL._replace(windows=other)
    assert "Poses" not in " ".join(report_of(known, causes.find(known), [], []))
    assert "The cause is not known" in advice.advise(known, causes.find(known))


def test_where_nothing_can_be_told_the_advice_is_how_to_tell():
    known = WELL._replace(photo_px=15.0, photo_width_px=4000.0)
    assert advice.advise(known, []) == advice.UNSEEN
    short = known._replace(windows=APART._replace(passes=0.1))
    assert advice.advise(short, []) == advice.LARGER
    few = known._replace(windows=APART._replace(test_photos=3))
    assert advice.advise(few, []) == advice.WIDER


@pytest.mark.parametrize(("is_sure", "begins"), [(False, "take"), (True, "fix the")])
def test_what_bad_renders_show_as_probable_waits_for_more_photos(is_sure, begins):
    """As of fox by 15 photos, whose own exposure drifts a little."""
    findings = [causes.Finding("sparse", 9.0, True)]
    findings.append(causes.Finding("exposure", 0.17, is_sure))
    assert advice.advise(WELL, findings).startswith(begins)


def test_a_gain_that_pays_is_told_where_nothing_is_wrong():
    assert "take the cameras of aligned" in advice.advise(WELL, [], [gain()])
    nothing = advice.advise(WELL, [], [gain(low=-0.1)])
    assert nothing.startswith("nothing about alignment")


def test_given_poses_that_aligning_did_not_help_are_found_anew_alone():
    known = WELL._replace(**FAULTS["camera"], poses_given=True)
    said = advice.advise(known, causes.find(known), [gain(low=-0.1)])
    assert said == advice.ANEW
    said = advice.advise(known, causes.find(known), [gain()])
    assert "Until then take the cameras of aligned" in said


def test_of_another_program_nobody_knows_whether_it_is_too_short():
    known = WELL._replace(**FAULTS["camera"], passes=math.nan)
    found = causes.find(known)
    assert [finding.cause for finding in found] == ["camera"]
    assert advice.advise(known, found).startswith("put its cameras right in a round")
    assert "nan" not in " ".join(report_of(known, found, [], []))
