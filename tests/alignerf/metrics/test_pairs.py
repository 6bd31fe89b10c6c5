"""Whether a pair is a photo and a render of it."""

import cv2
import numpy as np
import pytest

from alignerf import causes
from alignerf.metrics import pairs
from alignerf.verdict import report
from tests import judged_cases
from tests.alignerf.causes.cases import THEIRS

WIDE = judged_cases.picture(3, (400, 120))
# Neighbours of a film, 8 px apart.
PHOTOS = [WIDE[:, 8 * i : 8 * i + 160] for i in range(12)]
# Others have nothing in common.
DISTINCT = [judged_cases.picture(30 + i, (160, 120)) for i in range(12)]
OTHERS = judged_cases.picture(8, (400, 120))


def render_of(photo):
    """A photo as a model has it: blurred."""
    return cv2.GaussianBlur(photo, (0, 0), 1.5)


def seen(renders, photos=PHOTOS, counts=None, whole=True):
    everywhere = np.ones(photos[0].shape[:2], bool) if counts is None else counts
    return {
        f"v{i:02}": pairs.look(photo, render, everywhere, whole=whole)
        for i, (photo, render) in enumerate(zip(photos, renders, strict=True))
    }


def checked(renders, **options):
    found = seen(renders, **options)
    return pairs.check(found, list(found))


def kinds(found):
    return {kind for kind, _ in found.faults.values()}


def half(photo, value):
    render = render_of(photo)
    render[:60] = value
    return render


def darker(photo, by):
    return np.round(render_of(photo) / by).astype(np.uint8)


def packed(photo, quality=75):
    """A copy by JPEG."""
    options = [cv2.IMWRITE_JPEG_QUALITY, quality]
    return cv2.imdecode(cv2.imencode(".jpg", photo, options)[1], cv2.IMREAD_COLOR)


NONSENSE = {
    "the photos": (lambda photo: photo, "copy"),
    "copies": (packed, "copy"),
    "copies made darker": (lambda photo: (photo * 0.8).astype(np.uint8), "copy"),
    "one colour": (lambda photo: np.full_like(photo, 90), "flat"),
    "half black": (lambda photo: half(photo, 0), "empty"),
    "half grey": (lambda photo: half(photo, 128), "empty"),
    "upside down": (lambda photo: render_of(photo)[::-1, ::-1], "turned"),
    "mirrored": (lambda photo: render_of(photo)[:, ::-1], "turned"),
    "forty times darker": (lambda photo: darker(photo, 40), "bright"),
}


@pytest.mark.parametrize("name", NONSENSE)
def test_nonsense_is_named_and_stops_the_verdict(name):
    make, kind = NONSENSE[name]
    found = checked([make(photo) for photo in PHOTOS])
    assert kinds(found) == {kind}
    assert found.stops
    e = THEIRS._replace(pairs=found)
    findings = causes.find(e)
    assert [finding.cause.name for finding in findings] == ["pairs"]
    told = report.of(e, [])
    assert told["state"] == "unclear"
    assert f"12 of 12 are {pairs.KINDS[kind]}" in told["headline"]
    assert not told["because"] + told["measured"]
    assert report.advise(e, findings) == pairs.ADVICE[kind]


def test_a_splat_rendered_here_is_no_copy_however_good_it_is():
    everywhere = np.ones(PHOTOS[0].shape[:2], bool)
    for own, fault in ((True, None), (False, "copy")):
        one = pairs.look(PHOTOS[0], PHOTOS[0], everywhere, whole=True, own=own)
        assert one.fault == fault


def test_copies_of_photos_that_were_resampled(rng):
    """A lens was undone by a program, and again by us; soft renders are none."""
    copies, photos = [], []
    for photo in PHOTOS:
        noise = rng.normal(size=photo.shape)
        copies.append(np.clip(photo + 12 * noise, 0, 255).astype(np.uint8))
        photos.append(cv2.GaussianBlur(copies[-1], (0, 0), 0.9))
    own, other = pairs.detail(copies[0]), pairs.detail(photos[0])
    assert pairs.SHARP_COPY < pairs.likeness(own, other) < pairs.COPY
    assert kinds(checked(copies, photos=photos)) == {"copy"}
    assert not checked(photos, photos=copies).faults


def test_renders_of_another_scene():
    """Pictures of noise have no sky above, so that none is like another."""
    others = [judged_cases.picture(60 + i, (160, 120)) for i in range(12)]
    found = checked(list(map(render_of, others)))
    assert found.stops
    assert "strange" in kinds(found)


@pytest.mark.parametrize("shift_px", [-12, 9])
@pytest.mark.parametrize("zoom", [0.85, 1.0, 1.2])
def test_what_a_wrong_lens_does_to_all_alike_is_no_other_photo(shift_px, zoom):
    matrix = cv2.getRotationMatrix2D((80, 60), 0, zoom)
    matrix[0, 2] += shift_px
    renders = [
        cv2.warpAffine(one, matrix, (160, 120), borderMode=cv2.BORDER_REFLECT)
        for one in map(render_of, DISTINCT)
    ]
    assert not checked(renders, photos=DISTINCT).faults


def test_one_pair_is_held_to_its_photo():
    assert not checked([render_of(PHOTOS[0])], photos=PHOTOS[:1]).faults
    other = render_of(judged_cases.picture(60, (160, 120)))
    assert kinds(checked([other], photos=PHOTOS[:1])) == {"strange"}


@pytest.mark.parametrize("levels", [4.0, 10.0])
def test_a_render_as_fine_as_its_photo_is_no_copy(levels, rng):
    """Smooth colours of a model are off by a level and more."""
    renders = []
    for photo in PHOTOS:
        off = cv2.GaussianBlur(rng.normal(size=photo.shape), (0, 0), 20)
        render = photo + levels * off / off.std()
        renders.append(np.clip(np.round(render), 0, 255).astype(np.uint8))
    assert not checked(renders).faults


def test_two_captures_under_one_sky():
    """All pictures are bright above: what lies nearer tells."""
    sky = np.linspace(120, 0, 120)[:, None, None]
    both = [
        [judged_cases.picture(seed + i, (160, 120)) for i in range(12)]
        for seed in (20, 40)
    ]
    both = [
        [np.clip(0.5 * one + sky, 0, 255).astype(np.uint8) for one in photos]
        for photos in both
    ]
    renders = list(map(render_of, both[1]))
    assert checked(renders, photos=both[0]).stops
    assert not checked(renders, photos=both[1]).faults


@pytest.mark.parametrize("sigma_px", [1.5, 3.0, 6.0])
@pytest.mark.parametrize("shift_px", [0, 3])
@pytest.mark.parametrize("gain", [0.6, 1.0])
def test_blurred_shifted_and_darker_renders_are_pairs(sigma_px, shift_px, gain):
    renders = [np.roll(photo, shift_px, axis=1) for photo in PHOTOS]
    renders = [cv2.GaussianBlur(one, (0, 0), sigma_px) * gain for one in renders]
    assert not checked([one.astype(np.uint8) for one in renders]).faults


def test_a_transparent_background_is_no_emptiness():
    """Nor is what a photo's mask leaves out; a border that is all black is one."""
    counts = np.zeros((120, 160), bool)
    counts[70:] = True
    renders = [np.where(counts[..., None], render_of(p), np.uint8(0)) for p in PHOTOS]
    assert not checked(renders, counts=counts, whole=False).faults
    assert kinds(checked(renders, counts=counts)) == {"empty"}


def test_nothing_counts():
    found = checked(PHOTOS, counts=np.zeros((120, 160), bool))
    assert kinds(found) == {"flat"}


def test_swapped_views_are_named_and_few_are_left_out():
    """Neighbours of a film are alike, and still told apart."""
    renders = list(map(render_of, PHOTOS))
    assert not checked(renders).faults
    many = [*PHOTOS, *(OTHERS[:, 8 * i : 8 * i + 160] for i in range(12))]
    renders = list(map(render_of, many))
    renders[2], renders[3] = renders[3], renders[2]
    found = checked(renders, photos=many)
    shows = {"v02": "shows v03", "v03": "shows v02"}
    assert found.faults == {view: ("swapped", other) for view, other in shows.items()}
    assert not found.stops
    e = THEIRS._replace(pairs=found)
    told = report.of(e, [])
    assert "some renders are left out" in told["headline"]
    assert "2 of 24 are of other photos" in told["because"][0]
    assert "(v02 shows v03, v03 shows v02)" in told["because"][0]


def test_two_photos_of_one_place_are_not_swapped():
    """A film that stands still: a render may lie nearer to the other photo."""
    photos = [WIDE[:, x : x + 160] for x in (0, 6, 60, 120)]
    renders = [render_of(WIDE[:, x : x + 160]) for x in (2, 2, 60, 120)]
    assert not checked(renders, photos=photos).faults


def test_a_render_that_is_there_twice_is_named():
    renders = list(map(render_of, PHOTOS))
    renders[3] = renders[9]
    assert checked(renders).faults == {"v03": ("swapped", "shows v09")}


def test_a_bad_held_out_render_is_not_of_another_scene():
    found = seen([*map(render_of, PHOTOS[:11]), render_of(OTHERS[:, :160])])
    assert not pairs.check(found, [f"v{i:02}" for i in range(11)]).faults
    assert pairs.check(found, list(found)).faults == {"v11": ("strange", "")}


def test_no_pairs():
    found = pairs.check({}, [])
    assert not found.faults
    assert not found.stops


def on_blank(picture, level, share=0.5):
    """Its middle alone, before a background of a level; share: of each side."""
    shown = np.full_like(picture, level)
    h, w = (int(side * (1 - share) / 2) for side in picture.shape[:2])
    shown[h:-h, w:-w] = picture[h:-h, w:-w]
    return shown


@pytest.mark.parametrize("level", [0, 255])
@pytest.mark.parametrize("lost", [0.3, 0.5, 0.8])
def test_a_model_that_lacks_much_of_an_object_has_its_photos_on_a_blank(level, lost):
    """Whose a render is, the others say; half of another level is cut for sure."""
    photos = [on_blank(photo, level) for photo in DISTINCT]
    renders = [on_blank(render_of(photo), level) for photo in photos]
    for i, render in enumerate(renders[:8]):
        top = 30 + int(lost * 60) if i % 2 else 90 - int(lost * 60)
        render[slice(30, top) if i % 2 else slice(top, 90)] = level
    assert not checked(renders, photos=photos).faults
    cut = [half(photo, 255 - level) for photo in photos]
    assert checked(cut, photos=photos).stops
    nothing = [on_blank(render, level, 0.1) for render in renders]
    assert checked(nothing, photos=photos).stops
    assert checked(renders, photos=[*photos[1:], photos[0]]).stops
