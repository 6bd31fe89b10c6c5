"""Corrections of input cameras: the planted fault is named, and right ones stay."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf.sfm import bundle, correction, mistakes
from tests.alignerf.sfm import made


def turned(true, rotvec, views=slice(None)):
    """Cameras of which some are turned in their own frames."""
    poses = true.camtoworlds.copy()
    poses[views, :, :3] = poses[views, :, :3] @ Rotation.from_rotvec(rotvec).as_matrix()
    return true._replace(camtoworlds=poses)


def with_lens(true, *, focal=1.0, centre=(0.0, 0.0), views=slice(None)):
    lenses = true.camtopix.copy()
    lenses[views, :2, :2] *= focal
    lenses[views, :2, 2] += centre
    return true._replace(camtopix=lenses)


def exchanged(true, one, other):
    poses = true.camtoworlds.copy()
    poses[[one, other]] = poses[[other, one]]
    return true._replace(camtoworlds=poses)


def kinds(told):
    return [fault["kind"] for fault in told["faults"]]


def planted(case, true, rng):
    """(given cameras, those that the photos have, the kinds that are named)."""
    nearly = made.perturbed(true, 2.0, rng)
    other = with_lens(true, focal=1.6, views=[1, 4, 7, 10])
    one_far, lost = true.camtoworlds.copy(), true.camtoworlds.copy()
    one_far[6, :, 3] *= 50
    lost[6] = np.eye(4)[:3]
    anywhere = true.camtoworlds[rng.permutation(len(true.camtoworlds))]
    return {
        "right": (true, true, []),
        "poses": (nearly, true, ["poses"]),
        "focal length": (with_lens(true, focal=1.05), true, ["focal_length"]),
        "centre": (with_lens(true, centre=(20, -6)), true, ["principal_point"]),
        "focal length and poses": (
            with_lens(nearly, focal=1.05),
            true,
            ["focal_length", "poses"],
        ),
        "zoom": (true, other, ["zoom"]),
        "zoom and poses": (nearly, other, ["zoom", "poses"]),
        "all turned": (turned(true, [0.1, 0, 0]), true, ["poses"]),
        "two exchanged": (exchanged(true, 4, 5), true, ["views"]),
        "one turned": (turned(true, [0.06, 0, 0], [6]), true, ["views"]),
        "one far off": (true._replace(camtoworlds=one_far), true, ["views"]),
        "one lost": (true._replace(camtoworlds=lost), true, ["views"]),
        "none of these": (
            true._replace(camtoworlds=anywhere),
            true,
            ["unrelated"],
        ),
        "at one place": (
            true._replace(camtoworlds=true.camtoworlds * [1, 1, 1, 1e-200]),
            true,
            ["unrelated"],
        ),
        "nearly at one place": (
            true._replace(
                camtoworlds=np.concatenate(
                    [
                        true.camtoworlds[:, :, :3],
                        1e-3 * rng.normal(size=(len(true.camtopix), 3, 1)),
                    ],
                    axis=-1,
                )
            ),
            true,
            ["unrelated"],
        ),
    }[case]


# One of each kind that is named; `make tools` has the others, too.
CASES = ["right", "focal length", "zoom and poses", "two exchanged", "one lost"]
CASES += ["at one place"]
WHOLE = ["poses", "focal length and poses", "zoom", "all turned", "one turned"]
WHOLE += ["one far off", "centre", "none of these", "nearly at one place"]


@pytest.mark.parametrize(
    "case", [*CASES, *(pytest.param(case, marks=pytest.mark.whole) for case in WHOLE)]
)
def test_the_planted_fault_is_named_and_mended(rng, tmp_path, case):
    base = made.cameras(arc=2.5)
    given, true, named = planted(case, base, rng)
    matched = made.matched(true, rng, points=300)
    found, told = correction.correct(matched, given, tmp_path, 0, 1.0, lens=True)
    assert kinds(told) == named
    if not named:
        assert found is None
        assert "no gain" in told["why"]
        return
    assert told["accepted"]
    assert np.median(made.error_px(true, found.cameras, found)) < 0.3
    assert told["after_px"] < 0.3
    if case in ("focal length", "centre", "zoom"):
        # The lens is all that moves.
        np.testing.assert_array_equal(found.cameras.camtoworlds, true.camtoworlds)


LENSES = {
    "most zoomed": ({"focal": 1.6, "views": slice(3, 12)}, "zoom", "v03"),
    "second camera": ({"focal": 0.96, "views": slice(6, 12)}, "focal_length", "v06"),
    "its centre": ({"centre": (9, 0), "views": slice(6, 12)}, "principal_point", "v06"),
    "all": ({"focal": 0.96}, "focal_length", None),
}


@pytest.mark.parametrize("case", LENSES)
def test_a_lens_is_named_with_its_photos(case):
    options, kind, first = LENSES[case]
    given = made.cameras()
    if case in ("second camera", "its centre"):
        # The file has two cameras.
        given = with_lens(given, focal=1.3, views=slice(6, 12))
    names = [f"v{k:02d}" for k in range(12)]
    (fault,) = correction.of_lens(
        names, given, with_lens(given, **options), (made.WIDTH, made.HEIGHT), 1.0
    )
    assert fault["kind"] == kind
    assert fault["said"].partition(": v")[2][:2] == (first or "")[1:]


def test_focal_lengths_of_two_axes_and_of_single_photos_are_named(rng):
    given = made.cameras()
    given.camtopix[:, 1, 1] *= 1.05
    options = [f"v{k:02d}" for k in range(12)], (made.WIDTH, made.HEIGHT)
    (fault,) = correction.of_lens(options[0], given, made.cameras(), options[1], 1.0)
    assert "(520.0, 546.0) -> (520.0, 520.0)" in fault["said"]
    jittering = made.cameras()
    jittering.camtopix[:, :2, :2] *= np.exp(0.01 * rng.normal(size=(12, 1, 1)))
    (fault,) = correction.of_lens(
        options[0], jittering, made.cameras(), options[1], 1.0
    )
    assert "differ by up to" in fault["said"]


def test_cameras_that_see_no_point_have_no_reprojection_error(rng):
    true = made.cameras()
    points = bundle.Points(
        np.zeros((0, 3)),
        np.zeros((0, 3), np.uint8),
        [np.zeros(0, int)] * 12,
        np.full(12, np.nan),
    )
    found = bundle.Adjusted(true, points, [], [], None)
    told, _ = correction.difference(list("abcdefghijkl"), true, found, 1.0)
    assert told["reprojection_px"] is None
    assert told["pose_error_px"] == 0


def test_a_mistake_of_the_file_is_undone_first(rng, tmp_path):
    true = made.cameras(arc=2.5)
    given = true._replace(camtoworlds=mistakes.turned(true.camtoworlds))
    found, told = correction.correct(
        *(made.matched(true, rng), given, tmp_path, 0, 1.0),
        lens=True,
        convention="opencv",
    )
    assert kinds(told) == ["convention"]
    assert told["before_px"] > 10 * told["after_px"]
    np.testing.assert_allclose(found.cameras.camtoworlds, true.camtoworlds, atol=1e-12)


def test_zooms_by_exif_alone(rng, tmp_path):
    """Half of the photos have another zoom: none of the two is the usual one."""
    given = made.cameras(arc=2.5)
    true = with_lens(given, focal=1.5, views=slice(0, 6))
    by_exif = true.camtopix[:, 0, 0] * 1.03
    found, told = correction.correct(
        *(made.matched(true, rng), given, tmp_path, 0, 1.0),
        lens=True,
        focal_px=by_exif,
    )
    assert kinds(told)[0] in ("zoom", "focal_length")
    lengths = found.cameras.camtopix[:, 0, 0] / true.camtopix[:, 0, 0]
    np.testing.assert_allclose(lengths, 1, atol=0.01)


@pytest.mark.parametrize("bent", [True, pytest.param(False, marks=pytest.mark.whole)])
def test_a_lens_is_found_where_the_matches_show_it(rng, tmp_path, bent):
    true = made.cameras(distortion=(0.2, -0.05, 0, 0, 0) if bent else (0.0,) * 5)
    given = made.perturbed(made.cameras(), 2.0, rng)
    matched = made.matched(true, rng, points=900)
    found, told = correction.correct(matched, given, tmp_path, 0, 1.0, lens=True)
    if bent:
        assert told["distortion"][0] == pytest.approx(0.2, abs=0.03)
        assert kinds(told)[0] == "distortion"
        assert "distortion" not in told["kept"]
    else:
        assert told["distortion"] is None
        assert told["kept"][-1:] == ["distortion"]
    assert np.median(made.error_px(true, found.cameras, found)) < 0.3


@pytest.mark.parametrize("points", [0, 8])
def test_too_few_matches_change_nothing(rng, tmp_path, points):
    true = made.cameras()
    matched = made.matched(
        true, rng, points=max(points, 1), unseen=() if points else range(12)
    )
    found, told = correction.correct(matched, true, tmp_path, 0, 1.0, lens=False)
    assert found is None
    assert "too few" in told["why"]


def test_views_that_stay_wrong_are_named(rng):
    true = made.cameras()
    matched = made.matched(true, rng)
    wrong = turned(true, [30 / made.FOCAL_PX, 0, 0], [6])
    assert correction.still_off(matched, wrong, 1.0) == ["v06"]
    assert correction.still_off(matched, true, 1.0) == []


def test_matches_as_they_were_found_have_the_last_word(rng, tmp_path, monkeypatch):
    """Finer cameras that they lose by are not taken, though better than the input."""
    true = made.cameras()
    given = made.perturbed(true, 6.0, rng)

    def worse(adjusted, *args, **options):
        cameras = made.perturbed(adjusted.cameras, 2.0, rng)
        return adjusted._replace(cameras=cameras), {"accepted": True, "said": "finer"}

    monkeypatch.setattr(bundle, "again", worse)
    matched = made.matched(true, rng)
    found, told = correction.correct(matched, given, tmp_path, 0, 1.0, lens=True)
    assert told["again"]["accepted"] is False
    assert "lose" in told["again"]["said"]
    assert np.median(made.error_px(true, found.cameras, found)) < 0.6


def test_cameras_of_other_photos_are_refused(rng, tmp_path, monkeypatch):
    """No pose fits, and COLMAP finds none either: it takes a minute to see that."""

    def no_poses(*args, **options):
        raise bundle.TooFewError("COLMAP finds no poses of v03")

    monkeypatch.setattr(bundle, "anew", no_poses)
    true = made.cameras()
    matched = made.matched(true, rng, wrong=1.0, points=150)
    with pytest.raises(ValueError, match=r"do not fit these photos: .* v03"):
        correction.correct(matched, true, tmp_path, 0, 1.0, lens=True, where="scan")


def test_views_that_new_poses_do_not_have_are_named(rng, tmp_path):
    true = made.cameras()
    matched = made.matched(true, rng, unseen=[7])
    with pytest.raises(bundle.TooFewError, match=r"v07$"):
        bundle.anew(matched, true, tmp_path, seed=0)
