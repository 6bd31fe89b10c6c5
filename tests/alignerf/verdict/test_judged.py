"""The verdict on renders of another program."""

import json
import math

import pytest

from alignerf.verdict import advice, causes, judged
from tests.alignerf.verdict.test_causes import FAULTS, WELL, report_of

OF = judged.Judged("given", "COLMAP's model", "named like the photos")
THEIRS = WELL._replace(judged=OF, passes=math.nan, reprojection_px=math.nan)
EXPORT = "make export SCENE=theirs"
SHIFTS = {"flow_train_px": 1.2, "flow_test_px": None, "photo_px": 2.0}


@pytest.fixture(autouse=True)
def export(monkeypatch):
    monkeypatch.setattr(judged.provenance, "export_command", lambda: EXPORT)


def said(e):
    return report_of(e, causes.find(e), [], [])


def test_aligned_renders():
    lines = said(THEIRS)
    assert lines[0].startswith("Verdict: Aligned")
    assert lines[-1].startswith("To do: Nothing about alignment")


@pytest.mark.parametrize(
    ("cause", "todo"),
    [
        ("camera", f"corrected cameras: `{EXPORT}`"),
        ("motion", f"warped photos: `{EXPORT}`"),
        ("lens_shift", "half a pixel"),
        ("lens_distortion", "Calibrate"),
        ("blurred", "Leave out"),
        ("exposure", "appearance model"),
    ],
)
def test_advice_is_of_what_the_user_has(cause, todo):
    """Never of this program's own trainings, which there were none of."""
    text = said(THEIRS._replace(**FAULTS[cause]))[-1]
    assert todo in text
    assert "align:" not in text
    assert "rounds" not in text


def test_without_held_out_renders_it_is_said():
    """Few of them are no fault; that a model can hide wrong poses is said."""
    none = THEIRS._replace(test_views=0, flow_test_px=math.nan, psnr_test_db=math.nan)
    lines = said(none)
    assert any("No renders of held-out photos" in line for line in lines)
    assert not any("few" in line for line in lines)
    assert not any("unknown" in line for line in lines)
    few = said(none._replace(train_views=5))
    assert "5 renders are few" in few[1]


def test_held_out_renders_alone_are_enough():
    """As gsplat writes them."""
    e = THEIRS._replace(train_views=0, flow_train_px=math.nan, psnr_train_db=math.nan)
    e = e._replace(test_views=14, flow_test_px=1.2, camera_px=1.1)
    assert said(e)[0] == "Verdict: Misaligned by 2.4 px: poses are off."


@pytest.mark.parametrize("cause", ["camera", "motion"])
def test_what_is_not_exported_is_not_advised(cause):
    """There is an export only of cameras, and of photos that were learnt from."""
    e = THEIRS._replace(**FAULTS[cause])
    none = said(e._replace(judged=OF._replace(cameras="none")))[-1]
    assert none.startswith("To do: Give the cameras, too")
    held_out = {"train_views": 0, "flow_train_px": math.nan, "test_views": 14}
    held_out |= {"flow_test_px": 1.2, "psnr_train_db": math.nan}
    alone = said(e._replace(**held_out))[-1]
    assert alone.startswith("To do: Render the photos that the program has learnt from")


def test_a_unit_of_depth_that_nothing_told_is_said():
    def words(**keys):
        return " ".join(said(THEIRS._replace(judged=OF._replace(**keys))))

    assert judged.UNKNOWN_UNIT in words(depth_unit="nothing")
    assert judged.UNKNOWN_UNIT not in words(depth_unit="points")


@pytest.mark.parametrize("depth", judged.DEPTHS)
def test_what_depth_costs_is_said(depth):
    lines = said(THEIRS._replace(judged=OF._replace(depth=depth)))
    assert judged.DEPTHS[depth] in lines


def test_without_cameras_none_can_be_corrected():
    e = THEIRS._replace(judged=OF._replace(cameras="none"), **FAULTS["camera"])
    lines = said(e)
    assert "Give the cameras, too" in lines[-1]
    assert any("a field of view was assumed" in line for line in lines)


def test_other_scenes_have_none():
    assert judged.read({"width": 4}) is None
    with pytest.raises(ValueError, match="no depth in it"):
        judged.read({"judged": {}})


def test_advice_of_judged_renders_is_judgeds():
    assert advice.advise(THEIRS, []) == judged.advise(THEIRS, [])


def test_what_it_was_before_is_said(tmp_path):
    """After another training, on cameras that were put right."""
    path = tmp_path / "first" / "verdict.json"
    path.parent.mkdir()
    path.write_text(json.dumps({"verdict": ["Aligned."], "evidence": SHIFTS}))
    told = {"depth": "far", "cameras": "x", "layout": "x", "way": "taken"}
    found = judged.read({"judged": told}, path)
    lines = said(THEIRS._replace(judged=found))
    assert "Before, in first, it was 2.4 px on photos that were trained on." in lines


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        ({"verdict": ""}, "not the JSON that it should be: verdict is ''"),
        ({"verdict": []}, "verdict is not lines of text"),
        ({"evidence": {}}, "evidence: no flow_train_px in it"),
        (
            {"evidence": SHIFTS | {"flow_test_px": math.inf}},
            "evidence: flow_test_px is inf",
        ),
    ],
)
def test_a_tampered_judgement_is_compared_with_by_nobody(tmp_path, keys, fault):
    path = tmp_path / "verdict.json"
    path.write_text(json.dumps({"verdict": ["Aligned."], "evidence": SHIFTS} | keys))
    with pytest.raises(ValueError, match=rf"^{path}: {fault}"):
        judged.read_before(path)


@pytest.mark.parametrize(("camera_px", "named"), [(0.72, False), (1.5, True)])
def test_a_shift_that_all_share_is_no_error_of_each_camera(camera_px, named):
    """Half a pixel in x and y, by a wrong origin of pixels."""
    e = THEIRS._replace(flow_train_px=camera_px, camera_px=camera_px)
    e = e._replace(shift_px=0.7, shift_errors=20.0)
    found = {finding.cause for finding in causes.find(e)}
    assert "lens_shift" in found
    assert ("camera" in found) == named
    own = {finding.cause for finding in causes.find(e._replace(judged=None))}
    assert "camera" in own
