"""Plans of every config, and targets by name."""

import os
import re
from pathlib import Path

import pytest
import yaml

from alignerf.experiment import sources

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = sorted((ROOT / "workflow" / "config").glob("*.yaml"))


def write(folder, config):
    path = folder / "config.yaml"
    path.write_text(yaml.safe_dump(config, sort_keys=False))
    return path


def jobs_of(output):
    """{rule: number of jobs} of a dry run."""
    table = output.split("Job stats:")[1].split("\n\n")[0]
    jobs = dict(re.findall(r"^([\w.-]+) +(\d+)$", table, re.MULTILINE))
    return {rule: int(count) for rule, count in jobs.items() if rule != "total"}


def expected_jobs(config):
    """The trainings of a config by the paper's scheme, and what each one entails."""
    default = {"mipnerf360": {"rounds": 2}, "alignerf": {"alignerf": {}}}
    scenes, methods = len(config["scenes"]), config.get("methods", default).values()
    plain = [
        m.get("rounds", 0) for m in methods if not {"alignerf", "warm_start"} & m.keys()
    ]
    warm = [m["rounds"] for m in methods if "warm_start" in m]
    rows = sum(rounds + 1 for rounds in plain) + sum(warm)
    staged = [m.get("model") for m in methods if "alignerf" in m]
    jobs = {
        "train": scenes * sum(rounds + 1 for rounds in plain),
        "train_warm": scenes * sum(warm),
        "pretrain": scenes * len(set(staged)),
        "finetune": scenes * len(staged),
        "evaluate": scenes * (rows + len(staged)),
        "testset": scenes,
        "control_sets": scenes,
        "controls_table": scenes,
        "ranking_table": sum(
            scene["source"] == "courtyard" for scene in config["scenes"].values()
        ),
        "facts": scenes,
        "config": scenes,
        "misalignment_table": scenes,
        "displacement_table": scenes,
        "decompose": scenes * (rows + len(staged)),
        "figures": scenes,
        "crops": scenes * bool(staged),
    }
    return {rule: count for rule, count in jobs.items() if count}


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_config_can_be_planned(path, tmp_path, snakemake):
    config = yaml.safe_load(path.read_text())
    # Stand-ins for what lies on the user's disk.
    (tmp_path / "photos").mkdir()
    (tmp_path / "weights.npz").touch()
    for scene in config["scenes"].values():
        if scene.get("path"):
            scene["path"] = "photos"
    config["frequency_weights"] = "weights.npz"
    config["lpips"] = {"alex": "weights.npz", "squeeze": None}
    written = write(tmp_path, config)
    code, output = snakemake(tmp_path, "--configfile", written, "-n")
    assert code == 0, output
    jobs = jobs_of(output)
    if any(m.get("rounds") == "auto" for m in config.get("methods", {}).values()):
        # What follows is known when the flow of round 0 is.
        assert jobs["decide"] == len(config["scenes"])
        return
    wanted = expected_jobs(config)
    assert {rule: jobs.get(rule) for rule in wanted} == wanted


def test_the_configs_are_short():
    """They were 530 lines where each had to be complete."""
    assert sum(len(path.read_text().splitlines()) for path in CONFIGS) <= 265


def test_without_arguments_the_demo_is_planned(tmp_path, demo, snakemake):
    code, output = snakemake(tmp_path, "-n")
    assert code == 0
    assert jobs_of(output).items() >= expected_jobs(demo).items()
    assert not (tmp_path / "results").exists()


def test_a_scene_or_a_file_by_name(tmp_path, demo, snakemake):
    demo["scenes"]["my-yard.1"] = demo["scenes"]["courtyard"]
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-n")
    both, one = (jobs_of(snakemake(*options, *t)[1]) for t in ([], ["my-yard.1"]))
    assert one.pop("my-yard.1") == both.pop("all") == 1
    assert both == {rule: 2 * count for rule, count in one.items()}
    file = "results/my-yard.1/mipnerf360/round1/timing.json"
    jobs = {"poses_courtyard": 1, "train": 2, "render_views": 1, "align": 1}
    output = snakemake(*options, file, "--cores", "200")[1]
    assert jobs_of(output) == jobs
    # However many cores there are, what trains or renders has the accelerator alone,
    # and all of this machine.
    assert len(re.findall(r"resources: .*gpu=1", output)) == 3
    threads = re.findall(r"threads: (\d+)", output)
    assert threads.count(str(sources.WHOLE_MACHINE)) >= 4 * (os.cpu_count() > 1)
    code, output = snakemake(
        *options, "results/courtyard/mipnerf360/round01/timing.json"
    )
    assert code == 1
    assert "Traceback" not in output


def test_a_sweep_and_the_regimes_make_their_own_jobs_and_no_others(
    tmp_path, demo, snakemake
):
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-n")
    variants = demo["tradeoff"]["variants"]
    scales = {v["downscale"] for v in variants.values() if "downscale" in v}
    each = ("train_variant", "render_variant", "evaluate_variant")
    jobs = jobs_of(snakemake(*options, "tradeoff")[1])
    assert (
        jobs.items()
        >= {
            "poses_courtyard": 1,
            "shrink": len(scales),
            **dict.fromkeys(each, 1 + len(variants)),
            "tradeoff": 1,
        }.items()
    )
    assert not {"train", "figures", "misalignment_table"} & jobs.keys()
    jobs = jobs_of(snakemake(*options, "regimes")[1])
    # Unwarped, the method, warped once and twice; and the reference's other model.
    assert (jobs["regimes"], jobs["evaluate"], jobs["train"]) == (1, 4, 3 + 3)
    assert not {"misalignment_table", "figures", "decompose"} & jobs.keys()


def test_what_the_readme_prints_needs_no_number_of_cores(tmp_path, snakemake):
    code, output = snakemake(tmp_path, "--rulegraph")
    assert code == 0, output
    assert "digraph" in output
    assert "train" in output
    code, output = snakemake(tmp_path, "--lint")
    assert code == 0, output
