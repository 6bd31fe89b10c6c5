"""A step's seconds: timed for as long as asked, whatever a single one takes."""

import jax.numpy as jnp
import pytest

from alignerf.training import program


class Clock:
    """A clock that a step moves on, by the next of `times_s` and then by the last."""

    def __init__(self, *times_s):
        self.now_s, self.times_s, self.steps = 0.0, list(times_s), 0

    def __call__(self):
        return self.now_s

    def step(self, state):
        assert state == self.steps
        last = len(self.times_s) == 1
        self.now_s += self.times_s[0] if last else self.times_s.pop(0)
        self.steps += 1
        return state + 1, {"loss": jnp.zeros(())}

    def timed(self, max_s, at_once=10):
        options = {"max_s": max_s, "at_once": at_once, "clock": self}
        return program.step_time_s(self.step, 0, **options)


def test_the_first_step_does_not_count():
    assert Clock(60.0, 0.02).timed(5.0) == pytest.approx(0.02)


def test_a_step_that_stalls_does_not_count():
    clock = Clock(1.0, 0.02, *[0.02] * 35, 4.0, 0.02)
    assert clock.timed(8.0) == pytest.approx(0.02)


def test_it_ends_in_time():
    clock = Clock(0.02)
    clock.timed(5.0)
    assert clock.now_s == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize(("step_s", "steps"), [(1.0, 7), (6.0, 2)])
def test_slow_steps_are_timed_one_by_one(step_s, steps):
    """And once, where one takes longer than there is to time."""
    clock = Clock(step_s)
    assert clock.timed(5.0) == step_s
    assert clock.steps == steps
