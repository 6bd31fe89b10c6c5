"""The verdict's decision: each cause alone and in pairs, none where all is well."""

import itertools
import math

import pytest

from alignerf import causes, poses
from alignerf.causes import base, coverage
from alignerf.causes.shared import misalignment
from alignerf.page import pictures
from alignerf.verdict import report
from tests.alignerf.causes import cases
from tests.alignerf.causes.cases import APART, FAULTS, THEIRS, WELL

EVERY = {cause.name: cause for cause in causes.every()}
SPARSE = FAULTS["sparse"]
ACCEPTED = base.Matches(
    accepted=True,
    applied=False,
    before_px=1.3,
    after_px=0.5,
    pose_error_px=1.5,
    worst_px=4.0,
)
DENIED = ACCEPTED._replace(accepted=False, before_px=0.4)
# A part of what renders are apart by is the same in all.
SHIFTED = {"shift_px": 0.12, "shift_errors": 5.0, "flow_train_px": 0.2}
FORWARD = ACCEPTED._replace(
    kept=("focal", "distortion"),
    before_px=8.0,
    lens=cases.FINE._replace(
        changed=["distortion"], distortion_px=21.8, before_px=8.0, after_px=4.0
    ),
)
SPLAT = {
    "octaves": (0.01, 0.1, 0.6, 0.8, 0.9),
    "judged": cases.JUDGED._replace(trained_px=960),
    "distortion_px": 0.3,
    "distortion_errors": 6.0,
}
# Half a pixel in x and y, by a wrong origin of pixels.
ORIGIN = {"shift_px": 0.8, "shift_errors": 20.0}


def test_every_cause_is_a_record_of_its_own():
    assert {*FAULTS, *cases.OF_RENDERS, "pairs"} == {*EVERY}
    for key in ("name", "label"):
        assert len({getattr(cause, key) for cause in EVERY.values()}) == len(EVERY), key
    assert all(cause.advice for cause in EVERY.values())


@pytest.mark.parametrize("cause", FAULTS)
def test_each_cause_is_named_alone_and_surely_and_said_with_its_number(cause):
    e = cases.with_faults(cause)
    (found,) = [one for one in causes.find(e) if one.cause.name == cause]
    assert found.sure
    assert cases.named(e) == [cause]
    for sure in (True, False):
        one = found._replace(sure=sure)
        # Heading and sentence are equally sure.
        probably = one.called != one.called.replace("probably", "")
        assert probably == ("{probably}" in one.cause.called and not sure)
        assert not {*"{}"} & {*one.sentence}
        assert any(letter.isdigit() for letter in one.sentence)
        assert "nan" not in one.sentence


def test_two_causes_are_both_named_unless_one_explains_the_other():
    for pair in itertools.combinations(FAULTS, 2):
        e = cases.with_faults(*pair)
        hidden = {
            name
            for one in pair
            if EVERY[one].find(e).explains
            for name in EVERY[one].explains
            if not (EVERY[name].find(e) and EVERY[name].find(e).stands)
        }
        if e.matches:
            # They know the lens better than flows do; here they ask for one part.
            hidden |= {"lens_shift", "lens_distortion"}
            hidden |= {"focal"} if "rolling_shutter" in pair else set()
        assert set(cases.named(e)) == {*pair} - hidden, pair


@pytest.mark.parametrize("cause", cases.OF_RENDERS)
def test_what_only_renders_of_another_program_have(cause):
    e = THEIRS._replace(**cases.OF_RENDERS[cause])
    assert cases.named(e) == [cause]
    (found,) = causes.find(e)
    assert not {*"{}"} & {*found.sentence}
    assert cases.named(WELL._replace(**cases.OF_RENDERS[cause])) == []


def test_causes_compete():
    """What an established cause explains is no evidence for another."""
    flow = FAULTS["camera"] | FAULTS["motion"] | FAULTS["sparse"]
    for changes, named in (
        # A lens that is wrong moves flows and makes held-out photos worse.
        (FAULTS["focal"] | flow, ["focal"]),
        # Poses that matches call wrong beside it are named, too.
        (
            {"matches": cases.with_lens("focal")._replace(after_px=0.01)} | flow,
            ["camera"],
        ),
        (cases.OF_RENDERS["undertrained_renders"] | flow, ["undertrained_renders"]),
        # Poses that are far off blur renders as too short a training does.
        (
            cases.OF_RENDERS["undertrained_renders"] | {"matches": ACCEPTED} | flow,
            ["camera"],
        ),
        (FAULTS["camera"] | FAULTS["motion"], ["camera"]),
        (FAULTS["camera"] | {"moved_fraction": 0.5}, ["camera", "motion"]),
        # A gain that all renders have is no exposure that changes.
        (cases.OF_RENDERS["tone"] | {"exposure_ev": 0.01}, ["tone"]),
    ):
        assert cases.named(THEIRS._replace(**changes)) == named, changes


@pytest.mark.parametrize(
    ("before_px", "after_px", "moved", "width_px", "named"),
    [
        # As measured on beer, fruit, cup and scan65, patches of which were bent.
        (2.28, 1.27, 0.105, 288.0, ["motion"]),
        (2.59, 1.6, 0.17, 302.0, ["motion"]),
        (1.34, 1.34, 0.12, 384.0, ["motion"]),
        # Wrong poses besides, wrong poses alone, and an adjustment that failed.
        (3.44, 0.99, 0.1, 317.0, ["camera", "motion"]),
        (2.3, 0.21, 0.06, 400.0, ["camera"]),
        (2.85, 2.7, 0.01, 400.0, ["camera"]),
        # Of a larger photo matches are found less exactly.
        (1.4, 0.8, 0.05, 4000.0, ["camera"]),
    ],
)
def test_points_that_no_cameras_fit_have_moved(
    before_px, after_px, moved, width_px, named
):
    accepted = after_px < 0.9 * before_px
    m = cases.MATCHES._replace(accepted=accepted, before_px=before_px)
    m = m._replace(after_px=after_px, pose_error_px=3.0 * accepted, lens=None)
    flows = FAULTS["camera"] | {"moved_fraction": moved, "photo_width_px": width_px}
    e = WELL._replace(**flows, matches=m)
    assert cases.named(e) == named
    # No word of other cameras where these are no cause.
    text = " ".join(report.terminal(report.of(e, [])))
    assert ("no cameras fit:" in text) == (accepted and named == ["motion"])
    assert "camera" in named or "denied by matches" in text
    assert "camera" in named or "poses are off" not in text
    if "motion" in named:
        (told,) = [one for one in causes.find(e) if one.cause.name == "motion"]
        gauge = report.gauge(told, e)
        assert gauge["unit"] == "px"
        assert gauge["measured"].endswith(" px")
        assert gauge["allowed"] == "up to 0.52"
        assert "from where any cameras expect them" in told.sentence


def test_a_lens_is_held_to_what_right_cameras_leave():
    """It takes a little of what wrong poses are, by chance, and is not the cause."""
    some = cases.FINE._replace(
        changed=["focal"], focal_ratio=0.82, before_px=2.85, after_px=2.61
    )
    refused = cases.MATCHES._replace(before_px=2.85, after_px=2.7, lens=some)
    assert cases.named(WELL._replace(**FAULTS["camera"], matches=refused)) == ["camera"]
    # Adjusted cameras have another lens than the input ones.
    used = cases.with_lens("focal", focal_ratio=1.02)._replace(applied=True)
    assert cases.named(WELL._replace(matches=used._replace(left=cases.FINE))) == []
    again = used.lens._replace(changed=["shutter"], shutter_px=5.0)
    assert cases.named(WELL._replace(matches=used._replace(left=again))) == [
        "rolling_shutter"
    ]


def test_a_blur_is_no_gamma():
    """Less contrast follows from both; a gain does not."""
    short = cases.OF_RENDERS["undertrained_renders"]
    e = THEIRS._replace(**short, tone_gamma=1.4)
    assert cases.named(e) == ["undertrained_renders"]
    assert "tone" in cases.named(e._replace(tone_gain_ev=0.4, octaves=(0.1,) * 5))


def test_numbers_that_are_unknown_hide_no_other():
    assert cases.named(WELL._replace(exposure_ev=math.nan, shared_ev=0.5)) == [
        "exposure"
    ]
    e = THEIRS._replace(tone_gamma=math.nan, tone_gain_ev=0.5)
    assert cases.named(e) == ["tone"]


def test_no_cause_waits_for_itself():
    assert {cause.name for cause in causes.in_turn()} == {*EVERY}
    for cause in EVERY.values():
        assert {*cause.explains} <= {*EVERY}
        assert bool(cause.explains) == bool(cause.spoils)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({}, []),
        # A slow drift of exposure is named where depth can be trusted.
        ({"shared_ev": 0.3}, ["exposure"]),
        ({"shared_ev": 0.1}, []),
        ({"shared_ev": math.nan}, []),
        ({"shared_ev": 0.3, "epochs": 0.1}, ["undertrained"]),
        # A shift within its error is none.
        ({"shift_px": 0.5, "shift_errors": 2.0}, []),
        ({"shift_px": 0.5, "shift_errors": math.nan}, []),
        # More flow on test views alone is no misalignment.
        (SPARSE | {"camera_px": 1.65}, ["sparse"]),
        # Renders of the training views fit, and the points say what they hide.
        (SPARSE | {"reprojection_px": 1.3}, ["sparse", "camera"]),
        (SPARSE | {"reprojection_px": 0.7}, ["sparse"]),
        (SPARSE | {"reprojection_px": math.nan}, ["sparse"]),
        # Where photos suffice, the flow tells.
        ({"reprojection_px": 1.3}, []),
        # Without training renders test views tell.
        ({"flow_train_px": math.nan, "psnr_train_db": math.nan}, []),
        (
            {"flow_train_px": math.nan, "flow_test_px": 1.0, "camera_px": 0.9},
            ["camera"],
        ),
        # Of another program nobody knows whether it was trained too short.
        (FAULTS["camera"] | {"epochs": math.nan}, ["camera"]),
        ({"matches": ACCEPTED}, ["camera"]),
        ({"matches": ACCEPTED, "epochs": 0.1}, ["undertrained", "camera"]),
        ({"matches": ACCEPTED._replace(applied=True)}, []),
        ({"matches": DENIED}, []),
        # What matches deny no flow shows.
        (FAULTS["camera"] | {"matches": DENIED}, []),
        # An adjustment that failed is no witness.
        (FAULTS["camera"] | {"matches": DENIED._replace(before_px=15.0)}, ["camera"]),
        ({"crops": APART, "epochs": 0.1}, ["undertrained", "camera"]),
        ({"crops": APART._replace(camera_px=0.1)}, []),
    ],
)
def test_what_is_named(changes, named):
    assert cases.named(WELL._replace(**changes)) == named


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        # An adjustment finds nothing to improve; brightness moves flows a little.
        (SHIFTED | {"exposure_ev": 0.15, "moved_fraction": 0.11}, ["exposure"]),
        (SHIFTED, []),
        # Renders that another program draws half a pixel off: nothing else moves.
        (SHIFTED | {"shift_px": 0.34, "flow_train_px": 0.36}, ["lens_shift"]),
        # By another tone things seem to move.
        ({"tone_gain_ev": 0.33, "moved_fraction": 0.11}, ["tone"]),
        ({"tone_gain_ev": 0.33, "moved_fraction": 0.15}, ["tone", "motion"]),
        # In forward motion a lens stands for poses; it was free, and was refused.
        ({"matches": FORWARD}, ["camera"]),
        ({"matches": FORWARD._replace(kept=("focal",))}, ["lens_distortion", "camera"]),
        # A tenth of the steps: the second octave is gone, too.
        ({"octaves": (0.27, 0.42, 0.8, 1.0, 1.0)}, ["undertrained_renders"]),
        ({"octaves": (0.17, 0.42, 0.8, 1.0, 1.0)}, ["half_size"]),
        ({"octaves": (0.01, 0.1, 0.3, 0.5, 0.8)}, ["undertrained_renders"]),
        # And where a known fault may be what blurs them.
        ({"octaves": (0.27, 0.42, 0.8, 1.0, 1.0), "exposure_ev": 0.1}, ["exposure"]),
        # A splat of few steps, by a phone's poses, which knows its photos' size; then
        # by corrected cameras.
        (SHIFTED | SPLAT | {"matches": FORWARD}, ["camera"]),
        (SPLAT | {"tone_gain_ev": 0.15}, ["undertrained_renders"]),
        # Wrong poses take the finest octave, but not all of it.
        ({"octaves": (0.3, 0.64, 0.9, 1.0, 1.0), "matches": ACCEPTED}, ["camera"]),
        (
            {"octaves": (0.2, 0.64, 0.9, 1.0, 1.0), "matches": ACCEPTED},
            ["camera", "half_size"],
        ),
    ],
)
def test_what_is_explained_away(changes, named):
    e = THEIRS._replace(matches=cases.MATCHES)
    assert {*cases.named(e._replace(**changes))} == {*named}


@pytest.mark.parametrize(
    ("changes", "cause", "value", "sure"),
    [
        ({"shared_ev": 0.3, "exposure_ev": 0.07}, "exposure", 0.3, False),
        ({"moved_fraction": 0.08}, "motion", 8, False),
        ({"epochs": 0.4}, "undertrained", 0.4, False),
        ({"flow_train_px": 0.4, "camera_px": 0.3}, "camera", 0.6, False),
        ({"crops": APART}, "camera", 0.68, True),
        ({"crops": APART._replace(low_px=0.4)}, "camera", 0.68, False),
        ({"matches": ACCEPTED}, "camera", 1.5, False),
        (SPARSE | {"reprojection_px": 1.7}, "camera", 3.4, True),
    ],
)
def test_how_large_and_how_sure_it_is(changes, cause, value, sure):
    found = next(
        one
        for one in causes.find(WELL._replace(**changes))
        if one.cause is EVERY[cause]
    )
    assert (found.value, found.sure) == (pytest.approx(value), sure)


@pytest.mark.parametrize(("camera_px", "is_named"), [(0.82, False), (1.5, True)])
def test_a_shift_that_all_share_is_no_error_of_each_camera(camera_px, is_named):
    e = THEIRS._replace(flow_train_px=camera_px, camera_px=camera_px, **ORIGIN)
    assert cases.named(e) == [*["camera"] * is_named, "lens_shift"]
    # Our own trainings absorb nearly all of such a shift.
    assert {*cases.named(e._replace(judged=None))} == {"camera", "lens_shift"}


@pytest.mark.parametrize(
    ("train_db", "test_db", "degrees", "test_px", "is_named"),
    [
        # As they are: herz, whose photos are 25, castle, courtyard, flower.
        (26.1, 23.1, 19.9, 0.21, False),
        (27.9, 24.6, 16.4, 0.12, False),
        (28.0, 26.1, 14.5, 0.08, False),
        (27.3, 26.8, 1.5, 0.10, False),
        # With half of their photos: castle, fox, courtyard.
        (27.7, 22.0, 40.4, 0.42, True),
        (30.7, 25.4, 21.7, 0.13, True),
        (28.0, 24.3, 28.9, 0.13, True),
        # Where no depth is known the gap decides.
        (26.1, 23.1, math.nan, 0.21, False),
        (27.7, 22.0, math.nan, 0.42, True),
        # Fewer than three photos see most points.
        (27.7, 22.0, math.inf, 0.42, True),
    ],
)
@pytest.mark.parametrize("e", [WELL, THEIRS])
def test_photos_are_too_few_by_what_they_see(
    e, train_db, test_db, degrees, test_px, is_named
):
    e = e._replace(psnr_train_db=train_db, psnr_test_db=test_db, apart_deg=degrees)
    e = e._replace(flow_test_px=test_px)
    assert cases.named(e) == ["sparse"] * is_named
    # Where the count says it, the gap is no second cause.
    few = cases.named(e._replace(train_views=9, test_views=6))
    assert few == ["few_views"]


@pytest.mark.parametrize(
    ("train", "test", "said"),
    [
        (14, 2, "2 held-out photos are few: at least 5 are needed"),
        (9, 6, "9 photos to learn from are few: at least 12 are needed"),
        (
            *(9, 2),
            "9 photos to learn from and 2 held-out photos are few: at least 12 and 5 "
            "are needed",
        ),
    ],
)
def test_only_what_is_short_is_called_few(train, test, said):
    found = coverage.find_few_views(WELL._replace(train_views=train, test_views=test))
    assert (found.sure, found.said) == (True, said)


def test_a_splat_knows_its_photos_by_heart():
    e = THEIRS._replace(psnr_train_db=33.3, psnr_test_db=25.5, flow_test_px=0.18)
    assert cases.named(e._replace(apart_deg=16.4)) == []
    assert cases.named(e._replace(apart_deg=30.0)) == ["sparse"]


def test_what_the_camera_s_sentence_is_of():
    """The same number as the headline's, in px of the photo."""
    for changes, px in (
        (FAULTS["camera"], "2.4 px"),
        (FAULTS["camera"] | {"crops": APART}, "0.68 px"),
        (SPARSE | {"reprojection_px": 1.7}, "3.4 px"),
        ({"matches": ACCEPTED}, "1.5 px"),
    ):
        assert px in EVERY["camera"].find(WELL._replace(**changes)).said


@pytest.mark.parametrize(
    ("overfit_px", "wanted"),
    [(None, 0.25), (math.nan, 0.25), (0.1, 0.25), (0.49, 0.49)],
)
def test_a_shift_is_told_from_what_the_estimator_invents(overfit_px, wanted):
    assert misalignment.told_px(overfit_px) == wanted
    assert pictures.limit_of({"overfit_px": overfit_px}) == wanted
    e = WELL._replace(overfit_px=overfit_px)
    if overfit_px:
        for px, misaligned in ((0.99, False), (1.01, True)):
            e = e._replace(flow_train_px=px * wanted)
            assert misalignment.misaligned(e) is misaligned


def test_what_the_poses_warn_of_is_what_the_verdict_says():
    assert poses.FEW_TRAIN_VIEWS == misalignment.FEW_TRAIN_VIEWS
    assert poses.FEW_TEST_VIEWS == misalignment.FEW_TEST_VIEWS


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"tone_gain_ev": 0.8}, "0.80 stops darker"),
        (
            {"tone_gain_ev": -0.19},
            "All renders probably differ from their photos: 0.19",
        ),
        ({"tone_gamma": 1.6}, "a gamma of 1.60"),
        ({"tone_white_ev": 0.5}, "0.50 stops between color channels"),
    ],
)
def test_renders_of_another_tone_are_told(changes, says):
    """As a mean of a whole run: of ours there are none."""
    e = THEIRS._replace(**changes)
    (found,) = causes.find(e)
    assert says in found.sentence
    assert cases.named(WELL._replace(**changes)) == []
