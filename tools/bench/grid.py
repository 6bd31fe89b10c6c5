"""The hash grid's table: nanoseconds a lookup, forward and for the gradient.

A lookup reads the features of one of a cell's 8 corners on one level: a point makes
8 x levels of them. Points are uniform in the volume: no ray, no help from caches.
"""

import jax

from alignerf.fields import grid
from tools.bench import measure

# The setting that the goals were set for.
POINTS, LEVELS, FEATURES, LOG2_ENTRIES = 49_152, 8, 2, 17


def run(options):
    """Rows: forward, the gradient's pass alone, and both as training runs them."""
    count = 256 if options.quick else POINTS
    levels = grid.Levels.geometric(LEVELS, 16, 1024, 2**LOG2_ENTRIES)
    key_points, key_table, key_grad = jax.random.split(jax.random.key(0), 3)
    points = jax.random.uniform(key_points, (3, count))
    table = grid.table_init(key_table, (sum(levels.entries), FEATURES))

    def look_up(table):
        return grid.look_up(table, points, levels)

    found, pull = jax.jit(lambda table: jax.vjp(look_up, table))(table)
    cotangent = jax.random.normal(key_grad, found.shape)
    forward = jax.jit(look_up)
    backward = jax.jit(lambda pull, cotangent: pull(cotangent))
    both = jax.jit(lambda table: value_and_gradient(look_up, table, cotangent))
    arms = {
        "forward": lambda: forward(table),
        "gradient": lambda: backward(pull, cotangent),
        "forward and gradient": lambda: both(table),
    }
    goals = {"forward": 2.0, "gradient": 6.0}
    times = measure.interleave(arms, 3 * options.repeats)
    lookups = count * LEVELS * 8
    return [
        measure.Row(
            what=name,
            unit="ns a lookup",
            ours=measure.spread(1e9 * s / lookups for s in found),
            goal=measure.Goal("ours", "<=", goals[name]) if name in goals else None,
            note=f"{count:,} points, {LEVELS} levels, {FEATURES} features",
        )
        for name, found in times.items()
    ]


def value_and_gradient(function, x, cotangent):
    """Both, so that neither is left out as unused."""
    value, pull = jax.vjp(function, x)
    return value, pull(cotangent)
