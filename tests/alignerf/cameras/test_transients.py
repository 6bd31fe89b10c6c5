"""A textured plane seen by several cameras, with things in some of the photos."""

import math

import numpy as np
import pytest

from alignerf.cameras import exposure, transients
from alignerf.scenes import cameras

WIDTH, HEIGHT, DISTANCE = 96, 64, 4.0
PIXTOCAM = cameras.intrinsics(80.0, WIDTH, HEIGHT)


def plane(x):
    """Colours of the plane z = -DISTANCE at points [..., 3]."""
    u, v = 2 * x[..., 0], 3 * x[..., 1]
    waves = np.stack([np.sin(u) * np.cos(v), np.sin(u + v), np.cos(2 * u - v)], axis=-1)
    return 120 + 45 * waves


def render(pixtocam, camtoworld, size):
    """Levels [h, w, 3] of the plane."""
    y, x = np.indices(size)
    rays = cameras.pixels_to_rays(x, y, pixtocam, camtoworld)
    return plane(rays.origins + DISTANCE * rays.directions)


def view(shift, *, scale=1, stops=0.0, turn_px=0.0, change=None):
    """The plane from a centre moved by `shift` in x; change: of the photo [h, w, 3].

    turn_px: by how much its camera is wrong.
    """
    pixtocam = PIXTOCAM @ np.diag([1 / scale, 1 / scale, 1])
    camtoworld = np.eye(4)[:3].copy()
    camtoworld[0, 3] = shift
    size = scale * HEIGHT, scale * WIDTH
    levels = render(pixtocam, camtoworld, size) * 2.0**stops
    photo = np.clip(np.round(levels), 0, 255).astype(np.uint8)
    depth = np.full(photo.shape[:2], DISTANCE, np.float32)
    camtoworld[0, 3] += turn_px * DISTANCE / 80.0
    if change:
        change(photo)
    return exposure.View(photo, depth, pixtocam, camtoworld)


def small(one, shown=None):
    """A view made small; shown: its render [h, w, 3], by default of the plane."""
    if shown is None:
        shown = render(one.pixtocam, one.camtoworld, one.depth.shape)
    return transients.small(one, shown.astype(np.uint8))


def found(views):
    return transients.found([small(one) for one in views])


def thing(rng, share):
    """What puts a box of another colour into a photo, and where it is [h, w]."""
    where = np.zeros((HEIGHT, WIDTH), bool)
    high = round(math.sqrt(1.5 * share * WIDTH * HEIGHT))
    wide = round(share * WIDTH * HEIGHT / high)
    top, left = rng.integers(2, HEIGHT - high - 2), rng.integers(20, WIDTH - wide - 20)
    where[top : top + high, left : left + wide] = True
    colour = rng.choice([[230, 40, 40], [20, 25, 30], [240, 240, 235]])

    def change(photo):
        scale = len(photo) // HEIGHT
        photo[np.kron(where, np.ones((scale, scale), bool))] = colour

    return change, where


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("scale", [1, 4])
def test_things_are_found_where_they_are_and_nowhere_else(seed, scale):
    rng = np.random.default_rng(seed)
    every, share = rng.choice([2, 5]), rng.choice([0.02, 0.05, 0.15])
    things = {i: thing(rng, share) for i in range(0, 12, every)}
    views = [
        view(
            0.15 * i,
            scale=scale,
            stops=rng.normal(scale=0.1),
            change=things[i][0] if i in things else None,
        )
        for i in range(12)
    ]
    for i, one in enumerate(found(views)):
        assert one.known.mean() > 0.6
        if i not in things:
            assert one.share == 0
            continue
        k = -(-scale * WIDTH // transients.LONGEST_PX)
        where = np.kron(things[i][1], np.ones((scale, scale), bool))
        where = where[k // 2 :: k, k // 2 :: k] & one.known
        overlap = (where & one.shown).sum() / (where | one.shown).sum()
        # A blur of the photo takes a border of what is small.
        assert overlap > (0.5 if share > 0.02 else 0.35)
        assert one.share == pytest.approx(where.mean() / one.known.mean(), rel=0.6)


def test_brightness_blur_and_cameras_that_are_off_are_no_things():
    rng = np.random.default_rng(0)
    for spoilt in (
        {"stops": 0.8},
        {"stops": -0.8},
        {"turn_px": 2.0},
        {"change": lambda photo: np.copyto(photo, photo // 2 + 40)},
    ):
        views = [view(0.15 * i, **(spoilt if i % 4 == 0 else {})) for i in range(12)]
        assert not any(one.shown.any() for one in found(views)), spoilt
    noise = rng.normal(scale=6, size=(HEIGHT, WIDTH, 3))

    def noisy(photo):
        photo[:] = np.clip(photo + noise, 0, 255)

    assert not any(one.shown.any() for one in found([view(0, change=noisy)] * 5))


@pytest.mark.parametrize(
    "changed",
    [
        lambda one: one._replace(depth=np.full_like(one.depth, np.nan)),
        lambda one: one._replace(depth=np.full_like(one.depth, np.inf)),
        lambda one: one._replace(depth=np.zeros_like(one.depth)),
        lambda one: one._replace(depth=-one.depth),
        lambda one: one._replace(photo=np.zeros_like(one.photo)),
        lambda one: one._replace(photo=np.full_like(one.photo, 255)),
        lambda one: one._replace(counts=np.zeros(one.depth.shape, bool)),
        lambda one: one._replace(photo=255 - one.photo),
    ],
)
def test_what_cannot_be_told_is_unknown_and_never_a_thing(changed):
    with np.errstate(all="raise"):
        one = changed(view(0.0))
        assert not any(own.shown.any() for own in found([one] * 6))
        own, *others = found([one, *(view(0.1 * i) for i in range(1, 6))])
    assert not any(other.shown.any() for other in others)
    # A photo of which nothing is the same is another photo.
    assert math.isnan(own.share) or own.share < transients.MAX_PART


@pytest.mark.parametrize("stops", [0.0, -0.7])
def test_what_the_render_shows_as_well_is_no_thing_but_of_wrong_depth(stops):
    views = [
        view(0.15 * i, change=thing(np.random.default_rng(i), 0.05)[0])
        for i in range(12)
    ]
    told = found(views)
    assert all(one.shown.any() for one in told)
    darker = [(one.photo * 2.0**stops).astype(np.uint8) for one in views]
    theirs = [small(*pair) for pair in zip(views, darker, strict=True)]
    assert not any(one.shown.any() for one in transients.found(theirs))
    assert [one.known.sum() for one in told] == [
        one.known.sum() for one in transients.found(theirs)
    ]


def test_where_neighbours_disagree_its_own_render_tells():
    """People stand before the same place in all photos, each dressed otherwise."""

    def somebody(i):
        def change(photo):
            photo[16:32, 36:60] = np.roll([240, 20, 60], i) // (1 + i % 2)

        return change

    views = [view(0.02 * i, change=somebody(i)) for i in range(12)]
    told = found(views)
    assert sum(one.apart.any() for one in told) < sum(one.lacked.any() for one in told)
    assert 0.001 < transients.fraction(told) < 0.06
    # A held-out photo's render lacks what it likes.
    unlearned = [small(one)._replace(learned=False) for one in views]
    held_out = transients.found(unlearned)
    assert not any(one.lacked.any() for one in held_out)
    assert math.isnan(transients.fraction(held_out))
    # What a render lacks and others do not is its own fault.
    dark = [small(one, np.full((HEIGHT, WIDTH, 3), 60)) for one in map(view, [0.0] * 6)]
    assert transients.fraction(transients.found(dark)) == 0


def test_a_share_is_of_what_others_tell():
    """A render lacks more than that: of what neighbours do not see, too."""
    for seed in range(20):
        masks = np.random.default_rng(seed).random((4, 6, 8)) < seed / 20
        one = transients.Found(*masks[:2], masks[2] & masks[3], masks[2])
        assert math.isnan(one.share) if not one.known.any() else 0 <= one.share <= 1


@pytest.mark.parametrize("count", range(4))
def test_few_views_agree_on_nothing(count):
    own = found([view(0.1 * i) for i in range(count)])
    assert len(own) == count
    assert all(math.isnan(one.share) for one in own)
