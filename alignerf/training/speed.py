"""How long a step takes on this machine: timed on a state that is thrown away."""

import statistics
import time

import jax


def step_time_s(step, state, *, most_s, at_once, clock=time.perf_counter):
    """Median seconds of a step, timed for about `most_s` seconds.

    step: state -> (state, numbers); it uses up `state`. `at_once` steps are run
    before their numbers are fetched, as in training, where there is time for that.
    """

    def run(count):
        nonlocal state
        start, numbers = clock(), []
        for _ in range(count):
            state, stats = step(state)
            numbers.append(stats)
        jax.device_get(numbers)
        return (clock() - start) / count

    # The first step waits for memory and threads; the second tells how many fit.
    run(1)
    single_s = run(1)
    if single_s >= most_s:
        return single_s
    count = at_once if at_once * single_s < most_s / 3 else 1
    start, found = clock(), []
    while clock() - start < most_s:
        found.append(run(count))
    return statistics.median(found)
