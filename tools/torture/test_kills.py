"""A chain that is ended at random moments, again and again, ends in equal bytes."""

import signal
import subprocess
import time

import numpy as np
import pytest

from tools.torture import chains, running

# Seconds from a start to a kill: long enough for Snakemake to plan, now and then; and
# from its first job to a signal that it is to take.
KILL_S, STOP_S = (1.0, 25.0), (0.0, 10.0)


@pytest.fixture(scope="module")
def reference(root, tmp_path_factory):
    """A finished chain."""
    if not running.CASES:
        pytest.skip("make torture")
    # A shell's background processes ignore Ctrl-C, and so would all of these.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    chain = chains.make(root, tmp_path_factory.mktemp("reference"))
    chains.finish(chain)
    return chain


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_who_ends_a_chain_loses_nothing(reference, tmp_path, number):
    rng = np.random.default_rng([running.SEED, number])
    is_killed = number == signal.SIGKILL
    count = running.CASES // 30 if is_killed else 1
    chain = chains.make(reference.root, tmp_path, reference)
    for _ in range(count):
        child = chain.start()
        while not (is_killed or child.poll() or "jobid: " in chain.words()):
            time.sleep(0.5)
        try:
            code = child.wait(rng.uniform(*(KILL_S if is_killed else STOP_S)))
            assert code == 0, chain.words()
            break
        except subprocess.TimeoutExpired:
            if number == signal.SIGTERM:
                child.send_signal(number)
                child.wait()
            else:
                # The terminal sends it to all.
                chains.kill(child, number)
        assert chains.gone(child.pid), "jobs still run after 20 s"
        assert child.returncode != 0
        assert is_killed or "Traceback" not in chain.words()
        chain.unlock()
    chains.finish(chain)
    # It is equal to the reference, and leaves nothing half-written behind.
    assert chains.differences(reference, chain) == []
    assert chains.leftovers(chain) == []
