"""The order in which pixels are drawn."""

import jax
import numpy as np
import pytest

from alignerf.training import batches


def passes(rows, columns, count, steps, seed=0):
    """Numbers of the pixels drawn in each step [steps, count]."""
    draw = jax.jit(
        jax.vmap(
            lambda step: batches.shuffled_pixels(
                jax.random.key(seed), step, rows, columns, count
            )
        )
    )
    row, column = (np.asarray(x) for x in draw(np.arange(steps)))
    assert row.min() >= 0
    assert row.max() < rows
    assert column.min() >= 0
    assert column.max() < columns
    return row * columns + column


@pytest.mark.parametrize(
    ("rows", "columns", "count"), [(6300, 200, 512), (3, 1, 1), (1, 7, 7), (36, 40, 97)]
)
def test_every_pixel_is_drawn_once_before_any_is_drawn_twice(rows, columns, count):
    steps = rows * columns // count
    drawn = passes(rows, columns, count, steps)
    assert len(np.unique(drawn)) == drawn.size == steps * count
    assert rows * columns - drawn.size < count


def test_passes_and_seeds_have_orders_of_their_own():
    drawn = passes(60, 50, 100, 60)
    first, second = drawn[:30], drawn[30:]
    other = passes(60, 50, 100, 30, seed=1)
    for order in (second, other):
        assert len(np.unique(order)) == 3000
        assert (order != first).mean() > 0.99


def test_a_step_is_spread_like_random_pixels():
    """Of 6300 rows and 200 columns, in ten bands of each: as often as chance."""
    drawn = passes(6300, 200, 512, 400)
    for number, sides in ((drawn // 200, 6300), (drawn % 200, 200)):
        bands = np.array([np.bincount(s * 10 // sides, minlength=10) for s in number])
        # 51.2 expected; the standard deviation of a random draw is 6.8.
        assert abs(bands.mean(axis=0) - 51.2).max() < 1.5
        assert 5.5 < bands.std() < 8.0
    neighbours = np.corrcoef(drawn[:, :-1].ravel(), drawn[:, 1:].ravel())[0, 1]
    assert abs(neighbours) < 0.01


def test_a_batch_larger_than_all_pixels_takes_some_twice():
    counts = np.bincount(passes(2, 3, 13, 2)[0], minlength=6)
    assert set(counts) == {2, 3}
