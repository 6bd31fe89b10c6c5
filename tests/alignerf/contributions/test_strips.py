"""Strip by strip as all at once: no seams, whatever the strips, no hoard of rows."""

import jax
import numpy as np
import pytest
from scipy import ndimage

from alignerf.contributions import patch_conv, strips
from alignerf.io import machine
from alignerf.scenes import cameras
from alignerf.training import renderer
from tests import training_cases as cases

# From the smallest that can be reflected; width, height.
SIZES = [(4, 4), (4, 9), (9, 4), (5, 7), (13, 6), (6, 23)]


def pieces(image, size):
    """The image's pixels in pieces of a size, the last one filled up with others."""
    pixels = image.reshape(-1, image.shape[-1])
    pixels = np.concatenate([pixels, np.full((-len(pixels) % size, 1), np.nan)])
    return iter(np.split(pixels, len(pixels) // size))


@pytest.mark.parametrize("halo", [0, 1, 3])
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_strips_of_every_height_equal_the_whole(rng, width, height, halo):
    image = rng.normal(size=(height, width, 1))
    kernel = rng.normal(size=(2 * halo + 1, 2 * halo + 1))
    wanted = ndimage.correlate(image[..., 0], kernel, mode="mirror")
    inner = (slice(halo, -halo or None),) * 2
    for strip in range(1, height + 5):
        shapes = set()

        def colours_of(values, shapes=shapes):
            shapes.add(values.shape)
            return ndimage.correlate(values[..., 0], kernel)[inner][..., None]

        for size in (1, 5, width, 3 * width + 1, 1000):
            found = strips.colours(
                pieces(image, size),
                colours_of,
                width=width,
                height=height,
                strip=strip,
                halo=halo,
            )
            np.testing.assert_allclose(found[..., 0], wanted, atol=1e-12)
        # One program does for all.
        assert shapes == {(strip + 2 * halo, width + 2 * halo, 1)}


@pytest.mark.parametrize(("width", "height"), [(4, 4), (9, 13), (17, 10)])
def test_patch_convolution_has_no_seams(rng, width, height):
    f = rng.uniform(size=(height, width, 5)).astype(np.float32)
    head = patch_conv.PatchConv()
    params = jax.jit(head.init)(jax.random.key(3), f)
    params = jax.tree.map(
        lambda p: np.float32(p + 0.1 * rng.normal(size=p.shape)), params
    )
    wanted = jax.jit(head.apply)(params, f)
    padded = jax.jit(lambda f: head.apply(params, f, padded=True))
    for strip in {1, 2, 3, height - 1, height, height + 5}:
        found = strips.colours(
            iter([f.reshape(-1, 5)]),
            padded,
            width=width,
            height=height,
            strip=strip,
            halo=patch_conv.LAYERS,
        )
        np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-5)


def test_no_more_is_rendered_than_a_strip_needs():
    width, height, strip, halo, size = 10, 200, 4, 3, 7
    asked, held = 0, []

    def values():
        nonlocal asked
        for start in range(0, width * height, size):
            asked = start + size
            yield np.full((size, 2), float(start))

    def colours_of(values):
        done = len(held) * strip
        held.append(asked - (done + strip + halo) * width)
        return values[halo:-halo, halo:-halo]

    strips.colours(
        values(), colours_of, width=width, height=height, strip=strip, halo=halo
    )
    assert len(held) == height // strip
    assert max(held) < size


@pytest.mark.parametrize(("width", "height"), [(3, 9), (9, 3), (1, 1)])
def test_what_cannot_be_reflected_is_refused(width, height):
    with pytest.raises(ValueError, match=f"{width}x{height} pixels is too small"):
        strips.colours(None, None, width=width, height=height, strip=2, halo=3)


def test_a_view_is_the_same_in_strips(monkeypatch):
    method = cases.alignerf()
    params = jax.jit(method.init)(jax.random.key(0))
    camera = cameras.intrinsics(20.0, 23, 18), np.eye(4, dtype=np.float32)[:3]
    views = []
    for pixels in (10**6, 5 * 23, 1):
        monkeypatch.setattr(renderer, "STRIP_PIXELS", pixels)
        views.append(renderer.make_renderer(method, params, 23, 18)(*camera))
    image, depth = views[0]
    assert image.std() > 0
    for other, other_depth in views[1:]:
        # A rounding of 1e-7 may turn a half up or down.
        np.testing.assert_allclose(other.astype(int), image, atol=1)
        assert (other != image).mean() < 0.01
        np.testing.assert_array_equal(other_depth, depth)


@pytest.mark.parametrize("begun", [32, 96, 10**6])
def test_a_view_of_an_accelerator_is_that_of_a_cpu(monkeypatch, begun):
    """In threads, of whole views and of some pixels, in chunks of every size."""
    method = cases.alignerf()
    params = jax.jit(method.init)(jax.random.key(0))
    pixtocam = cameras.intrinsics(20.0, 23, 18)
    poses = np.repeat(np.eye(4, dtype=np.float32)[None, :3], 3, axis=0)
    poses[:, 0, 3] = [0.0, 0.2, 0.4]
    left = np.arange(23) < 9 + np.arange(18)[:, None] % 5
    views = [(pose, wanted) for pose in poses for wanted in (None, left)]

    def rendered():
        render = renderer.make_renderer(method, params, 23, 18)
        return list(machine.map_in_threads(lambda one: render(pixtocam, *one), views))

    whole = rendered()
    monkeypatch.setattr(renderer, "on_accelerator", lambda: True)
    monkeypatch.setattr(renderer, "BEGUN_RAYS", begun)
    monkeypatch.setattr(renderer, "TOGETHER_RAYS", 32)
    monkeypatch.setattr(renderer, "STRIP_PIXELS", 5 * 23)
    monkeypatch.delattr(renderer.Renderer, "values")
    for (image, depth), wanted, (_, mask) in zip(rendered(), whole, views, strict=True):
        mask = np.ones((18, 23), bool) if mask is None else mask
        assert image.dtype == np.uint8
        # A rounding of 1e-7 may turn a half up or down.
        differs = image[mask].astype(int) - wanted[0][mask]
        assert abs(differs).max() <= 1
        assert (differs != 0).mean() < 0.01
        np.testing.assert_array_equal(depth, wanted[1])
