"""What the verdict reads of crops, and of another program's renders."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from alignerf.metrics import pairs
from alignerf.verdict import evidence
from tests.alignerf.cameras import test_transients as planes
from tests.alignerf.causes import cases


def table(folder, **flows):
    rows = [
        {"view": view, "flow_median_px": flow_px, "camera_median_px": flow_px / 2}
        for view, flow_px in flows.items()
    ]
    pd.DataFrame(rows).to_csv(folder / "decomposition_photos_train.csv", index=False)


def test_a_photo_has_the_median_of_its_crops(tmp_path):
    table(tmp_path, a_w0=1.0, a_w1=3.0, b_w_w0=5.0)
    np.testing.assert_array_equal(evidence.of_photos(tmp_path, "train", "flow"), [2, 5])
    np.testing.assert_array_equal(
        evidence.of_photos(tmp_path, "train", "camera"), [1, 2.5]
    )


def test_a_photo_without_valid_flow_spoils_no_other(tmp_path):
    table(tmp_path, a_w0=1.0, b_w0=math.nan, c_w0=3.0)
    flows = evidence.of_photos(tmp_path, "train", "flow")
    assert evidence.median(flows) == 2
    low, high = evidence.interval_of_median(flows)
    assert 1 <= low <= high <= 3
    assert math.isnan(evidence.median(flows[:0]))
    assert all(map(math.isnan, evidence.interval_of_median(flows[:1])))
    # One photo of nine that is far off moves no median, and the mean by 100.
    assert evidence.interval_of_median(np.array([1.0] * 8 + [900.0])) == (1.0, 1.0)


def test_without_crops_there_are_none():
    assert evidence.read_crops(None) is None


SHIFTS = {"flow_train_px": 1.2, "flow_test_px": None, "photo_px": 2.0}


def test_how_another_program_s_renders_were_put_together(tmp_path):
    """And what it was before, which is another file of the user's."""
    assert evidence.read_judged({"width": 4}) is None
    path = tmp_path / "first" / "verdict.json"
    path.parent.mkdir()
    path.write_text(json.dumps({"evidence": SHIFTS}))
    told = {"depth": "far", "cameras": "x", "layout": "x", "way": "taken"}
    found = evidence.read_judged({"external_renders": told}, path)
    assert (found.depth, found.before) == ("far", ("first", 2.4, None, None))
    scores = dict.fromkeys(evidence.SCORED, 2.5) | {"ssim": None}
    text = json.dumps({"evidence": SHIFTS | {"judged": {"scores": scores}}})
    path.write_text(text)
    assert evidence.read_before(path, None)[-1] == scores
    path.write_text(text.replace("2.5", '"x"'))
    with pytest.raises(ValueError, match=r"judged\.scores\.\w+ is 'x'"):
        evidence.read_before(path, None)


def test_scores_are_of_held_out_views():
    """Sharpness is the renders' detail over the photos'."""
    views = [
        SimpleNamespace(
            row=SimpleNamespace(split=split, psnr_db=psnr_db, sharpness_ratio=ratio),
            scores={} if split == "train" else {"ssim": ssim},
        )
        for split, psnr_db, ratio, ssim in (
            ("train", 40.0, 1.0, np.nan),
            ("test", 20.0, 2.0, 0.5),
            ("test", 22.0, 1.0, 0.7),
        )
    ]
    found = evidence.scores_of(views, 64)
    wanted = {"views": 2, "width_px": 64, "psnr_db": 21.0, "ssim": 0.6}
    assert found == pytest.approx(wanted | {"sharpness": 0.75})
    assert tuple(found) == evidence.SCORED
    assert evidence.scores_of(views[:1], 64) is None


def seen(name, **changes):
    """What is known of a view, as far as photos are named by it."""
    usual = {"transient_fraction": 0.0, "sharpness_ratio": 1.0, "moved_fraction": 0.0}
    hidden = changes.pop("hidden", 0.0)
    return SimpleNamespace(
        row=SimpleNamespace(view=name, **usual | changes), hidden=hidden
    )


def test_what_is_said_of_some_photos_names_them():
    found = [seen(f"v{i}") for i in range(6)] + [
        seen("left out", transient_fraction=0.5),
        seen("passer-by", transient_fraction=0.03, moved_fraction=0.2),
        seen("soft", sharpness_ratio=0.3, hidden=0.2),
        seen("unknown", transient_fraction=math.nan, hidden=math.nan),
    ]
    assert evidence.photos_of(found, 1.0, {"left out": ("swapped", "")}) == {
        "transients": ("passer-by",),
        "motion": ("passer-by",),
        "blurred": ("soft",),
        "floaters": ("soft",),
    }


@pytest.mark.parametrize(
    ("depth", "bad", "known"),
    [
        *(("given", bad, known) for bad, known in (((), 9), ((1,), 8), (range(5), 0))),
        *((depth, (), 0) for depth in ("points", "far")),
    ],
)
def test_things_are_looked_for_where_depth_moves_photos_and_pairs_are_right(
    depth, bad, known
):
    views = [planes.small(planes.view(0.15 * i)) for i in range(9)]
    found = [
        SimpleNamespace(row=SimpleNamespace(view=str(i)), place=view)
        for i, view in enumerate(views)
    ]
    checked = pairs.Checked(20, {str(i): ("swapped", "") for i in bad})
    judged = cases.JUDGED._replace(depth=depth)
    masks = evidence.transients_of(found, checked, judged)
    assert sum(one.known.any() for one in masks) == known
    assert not any(masks[i].known.any() for i in bad)
