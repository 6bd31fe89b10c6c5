"""Many cases on both cores, until their time is used.

Each worker has a folder of its own, so that no case sees another's files.
"""

import concurrent.futures
import itertools
import math
import random
import shutil
import threading
import time
import traceback
from typing import NamedTuple

import numpy as np

from alignerf.io import progress

WORKERS = 2


class Tried(NamedTuple):
    """How many cases applied, of how many that there are, and findings in words."""

    cases: int
    of: int
    found: list


def tried(attack, cases, *, until, places, seed) -> Tried:
    """Attack cases in an order by the seed, one worker a place, until a time.

    attack: function(case, place, rng) that returns a finding or None, and False where
    the case does not apply. What it raises is a finding too. Without an end the cases
    keep their order.
    """
    order = list(cases)
    if until < math.inf:
        random.Random(seed).shuffle(order)
    queue, lock = iter(enumerate(order)), threading.Lock()
    bar = progress.Progress("attack", len(order), unit="case")
    found = []

    def work(place):
        while time.monotonic() < until:
            with lock:
                number, case = next(queue, (None, None))
            if number is None:
                return
            one = of_case(attack, case, place, np.random.default_rng([seed, number]))
            with lock:
                found.append(one)
                bar.advance()

    if len(places) == 1:
        # In this process's main thread: some attacks change its folder.
        work(places[0])
    else:
        with concurrent.futures.ThreadPoolExecutor(len(places)) as pool:
            list(pool.map(work, places))
    bar.close()
    for place in places:
        shutil.rmtree(place, ignore_errors=True)
    unfit = sum(one is False for one in found)
    said = [one for one in found if one]
    return Tried(len(found) - unfit, len(order) - unfit, said)


def of_case(attack, case, place, rng):
    """What the attack says of a case; a fault of its own is said too."""
    try:
        return attack(case, place, rng)
    except Exception:
        lines = traceback.format_exc().splitlines()
        return f"{str(case)[:200]}: the attack failed: {' / '.join(lines[-3:])}"


def together(functions, workers=WORKERS):
    """What functions without arguments return, two at a time, in their order."""
    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        return list(pool.map(lambda function: function(), functions))


def shared(count, workers=WORKERS):
    """A number, split among workers."""
    edges = [count * i // workers for i in range(workers + 1)]
    return [b - a for a, b in itertools.pairwise(edges)]
