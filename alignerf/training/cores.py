"""The cores of a CPU: threads that render, devices that train.

A small model's operations are too short for XLA to share one between cores. Two
threads on two cores render a hash grid 1.9 times as fast as one does, and as two
devices they train it 1.3 times as fast as one of two threads, an MLP 1.05 times.
"""

import logging
import os

import jax

from alignerf.command import machine

log = logging.getLogger("alignerf")

# Beyond these, further devices have less to do and more gradients to add up.
MOST_DEVICES = 4


def use_as_devices():
    """Let every core be a device of JAX, where there is no accelerator.

    Only the first thing that a process does with JAX can: later they stay as they
    are, which is said; so they do where the user has said how many in XLA_FLAGS.
    """
    if "xla_force_host_platform_device_count" in os.environ.get("XLA_FLAGS", ""):
        return
    wanted = min(machine.cores(), MOST_DEVICES)
    try:
        jax.config.update("jax_num_cpu_devices", wanted)
    except RuntimeError:
        devices = jax.local_devices()
        if devices[0].platform == "cpu" and len(devices) != wanted:
            log.warning(
                "too late for a device each of %d cores: JAX has started with %d",
                *(wanted, len(devices)),
            )


def map_in_threads(function, items):
    """`machine.map_in_threads` on a CPU; an accelerator takes one at a time."""
    on_cpu = jax.local_devices()[0].platform == "cpu"
    return machine.map_in_threads(function, items, threads=None if on_cpu else 1)
