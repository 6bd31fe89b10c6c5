"""The rank of this process, from the environment of its launcher. No JAX here.

`srun` and `mpirun` set variables of their own. By hand a user sets
JAX_COORDINATOR_ADDRESS (host:port of the first process), JAX_NUM_PROCESSES and
JAX_PROCESS_ID (from 0).
"""

import re
from typing import NamedTuple

# By hand; and how srun and mpirun tell a process of how many it is, and which.
ADDRESS = "JAX_COORDINATOR_ADDRESS"
BY_HAND = ("JAX_NUM_PROCESSES", "JAX_PROCESS_ID")
# mpirun first: inside a step of Slurm's both speak.
LAUNCHERS = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),
)
# The ports of a job's steps: trainings on one node have others, but for a chance.
FIRST_PORT, PORTS = 61440, 4096


class Rank(NamedTuple):
    """A process's number among the processes of a training, and their count."""

    number: int
    count: int


_here = Rank(0, 1)


def here() -> Rank:
    """This process's rank; the only one of its training, until `take`."""
    return _here


def take(rank: Rank):
    """Set this process's rank."""
    global _here
    _here = rank


def is_first() -> bool:
    """Whether this process reads checkpoints and writes files."""
    return _here.number == 0


def are_several() -> bool:
    """Whether there are other processes."""
    return _here.count > 1


def from_environment(environ) -> Rank:
    """This process's rank by the environment.

    Raises ValueError where only some of the variables BY_HAND are set. A batch job of
    Slurm with several tasks is one process until `srun` starts them.
    """
    said = [name for name in BY_HAND if environ.get(name)]
    if said:
        missing = [name for name in (ADDRESS, *BY_HAND) if not environ.get(name)]
        if missing:
            raise ValueError(f"environment: {said[0]} without {', '.join(missing)}")
        if not re.search(r".:\d+\Z", environ[ADDRESS]):
            raise ValueError(f"environment: {ADDRESS}={environ[ADDRESS]}: no host:port")
        return numbered(environ, *BY_HAND)
    for names in LAUNCHERS:
        if all(environ.get(name) for name in names):
            return numbered(environ, *names)
    return Rank(0, 1)


def numbered(environ, count, number) -> Rank:
    """The rank that two environment variables name; ValueError where they do not."""
    for name in (count, number):
        if not (environ[name].isascii() and environ[name].isdigit()):
            raise ValueError(f"environment: {name}={environ[name]!r:.40}: no number")
    rank = Rank(int(environ[number]), int(environ[count]))
    if not rank.number < rank.count:
        raise ValueError(
            f"environment: {number}={rank.number} of {count}={rank.count} processes: "
            "they count from 0"
        )
    return rank


def port(environ) -> int:
    """A port for the first process of a Slurm job step."""
    job, step = (int(environ.get(n, 0)) for n in ("SLURM_JOB_ID", "SLURM_STEP_ID"))
    return FIRST_PORT + (job * 31 + step) % PORTS


def accelerators(environ):
    """Indices of the visible accelerators that a process takes; None: JAX decides.

    JAX takes the one with the process's number on its host. Where `srun` shows each
    process one of its own (`--gpus-per-task`), that one has number 0.
    """
    seen = environ.get("CUDA_VISIBLE_DEVICES", "").split(",")
    return [0] if seen != [""] and len(seen) == 1 else None
