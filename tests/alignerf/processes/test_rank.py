"""Which process this is, as launchers say it."""

import pytest

from alignerf.processes import rank

SLURM = {"SLURM_STEP_NUM_TASKS": "4", "SLURM_PROCID": "2", "SLURM_JOB_ID": "7"}
BY_HAND = {"JAX_COORDINATOR_ADDRESS": "a:1", "JAX_NUM_PROCESSES": "3"}


@pytest.mark.parametrize(
    ("environ", "found"),
    [
        ({}, (0, 1)),
        (SLURM, (2, 4)),
        # A batch job with four tasks, before srun.
        ({"SLURM_NTASKS": "4", "SLURM_PROCID": "0", "SLURM_JOB_ID": "7"}, (0, 1)),
        ({"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "1"}, (1, 2)),
        (BY_HAND | {"JAX_PROCESS_ID": "1"}, (1, 3)),
        # mpirun within a step of one task.
        (
            {
                "SLURM_STEP_NUM_TASKS": "1",
                "SLURM_PROCID": "0",
                "OMPI_COMM_WORLD_SIZE": "4",
                "OMPI_COMM_WORLD_RANK": "2",
            },
            (2, 4),
        ),
        (SLURM | BY_HAND | {"JAX_PROCESS_ID": "0"}, (0, 3)),
    ],
)
def test_the_environment_says_which_process_this_is(environ, found):
    assert rank.from_environment(environ) == found


@pytest.mark.parametrize(
    ("environ", "message"),
    [
        (BY_HAND, "JAX_NUM_PROCESSES without JAX_PROCESS_ID"),
        ({"JAX_NUM_PROCESSES": "2", "JAX_PROCESS_ID": "0"}, "JAX_COORDINATOR_ADDRESS"),
        (BY_HAND | {"JAX_PROCESS_ID": "3"}, "JAX_PROCESS_ID=3 of JAX_NUM_PROCESSES=3"),
        (
            {**BY_HAND, "JAX_PROCESS_ID": "1", "JAX_COORDINATOR_ADDRESS": "nonsense"},
            "JAX_COORDINATOR_ADDRESS=nonsense: no host:port",
        ),
        (BY_HAND | {"JAX_PROCESS_ID": "-1"}, "JAX_PROCESS_ID='-1': no number"),
        (SLURM | {"SLURM_STEP_NUM_TASKS": "x"}, "SLURM_STEP_NUM_TASKS='x': no number"),
    ],
)
def test_half_of_an_environment_is_refused(environ, message):
    with pytest.raises(ValueError, match=message):
        rank.from_environment(environ)


def test_steps_of_jobs_have_ports_of_their_own():
    found = {
        rank.port({"SLURM_JOB_ID": str(job), "SLURM_STEP_ID": str(step)})
        for job in range(5)
        for step in range(8)
    }
    assert len(found) == 40
    assert min(found) > 1023
    assert max(found) < 65536


@pytest.mark.parametrize(
    ("seen", "taken"), [(None, None), ("", None), ("0,1", None), ("3", [0])]
)
def test_a_process_takes_the_only_device_that_it_sees(seen, taken):
    environ = {} if seen is None else {"CUDA_VISIBLE_DEVICES": seen}
    assert rank.accelerators(environ) == taken
