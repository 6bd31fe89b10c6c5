"""Results that a storage keeps elsewhere; what is said of jobs that Slurm has ended."""

import pytest

from alignerf.experiment import cluster


@pytest.fixture
def places(tmp_path):
    return tmp_path / "copies" / "results", tmp_path / "results"


def link(scenes, copies, results):
    """With `copies` as the folder that Snakemake has for `results`."""
    cluster.link(scenes, copies / "{scene}" / "config.yaml", results)


def test_scenes_lead_to_the_copies(places):
    copies, results = places
    for _ in range(2):
        link(["a", "b c"], copies, results)
        (results / "b c" / "facts.json").write_text("{}")
        assert (copies / "b c" / "facts.json").read_text() == "{}"
    # What is in another bucket is not its.
    with pytest.raises(ValueError, match="in another storage"):
        link(["a"], copies.parent / "other", results)


def test_without_a_storage_nothing_is_made(tmp_path):
    link(["a"], tmp_path / "results", tmp_path / "results")
    assert not list(tmp_path.iterdir())


def test_results_on_the_disk_are_left_alone(places):
    copies, results = places
    (results / "a").mkdir(parents=True)
    with pytest.raises(ValueError, match="lies on the disk"):
        link(["a"], copies, results)
    assert not (results / "a").is_symlink()


def test_a_link_that_a_storage_has_left_is_named(tmp_path):
    copies = tmp_path / ".snakemake/storage/s3/bucket/results"
    results = tmp_path / "results"
    link(["a"], copies, results)
    with pytest.raises(ValueError, match="leads into a storage"):
        link(["a"], results, results)
    # Its copies may have been cleaned away.
    (copies / "a").rmdir()
    link(["a"], copies, results)
    assert (results / "a").is_dir()
    (copies / "a").rmdir()
    with pytest.raises(ValueError, match="in another storage"):
        link(["a"], tmp_path / "other", results)


LOST = """
    message: SLURM-job '12' failed, SLURM status is: 'TIMEOUT'. For further
    message: SLURM-job '13' failed, SLURM status is: 'FAILED'.
    message: SLURM-job '14' failed due to a node failure, SLURM status is: 'NODE_FAIL'.
    message: SLURM sbatch failed. The error message was 'sbatch: error: Too much
sbatch: error: Batch job submission failed'.
"""


def test_what_slurm_ended_or_refused_is_said_in_words(tmp_path):
    log = tmp_path / ".snakemake/slurm_logs/rule_train/13.log"
    log.parent.mkdir(parents=True)
    log.write_text("slurmstepd: error: Detected 1 oom-kill event(s) in StepId=13.0.\n")
    said = cluster.slurm_errors(LOST, ["results/s/train.log", str(log)])
    assert [line.removeprefix("error: Slurm") for line in said] == [
        "'s job 12 took longer than it had asked for (TIMEOUT)",
        "'s job 13 took more memory than it had asked for (OUT_OF_MEMORY)",
        "'s job 14 lost its node (NODE_FAIL)",
        " refused a job: Too much; Batch job submission failed",
    ]


def test_of_other_runs_nothing_is_said():
    assert cluster.slurm_errors("Error in rule train: x", ["results/s/train.log"]) == []
