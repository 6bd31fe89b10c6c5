"""Plans of every config, and targets by name."""

import importlib
import pstats
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from alignerf.command import machine
from alignerf.experiment import sources
from tests.bench import planning

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
    others = {"alignerf", "warm_start", "align"}
    plain = [m.get("rounds", 0) for m in methods if not others & m.keys()]
    aligning = sum("align" in m for m in methods)
    warm = [m["rounds"] for m in methods if "warm_start" in m]
    rows = sum(rounds + 1 for rounds in plain) + sum(warm) + aligning
    staged = [m.get("model") for m in methods if "alignerf" in m]
    jobs = {
        "train": scenes * sum(rounds + 1 for rounds in plain),
        "train_warm": scenes * sum(warm),
        "train_aligning": scenes * aligning,
        "pretrain": scenes * len(set(staged)),
        "finetune": scenes * len(staged),
        "evaluate": scenes * (rows + len(staged)),
        "testset": scenes,
        "control_sets": scenes,
        "facts": scenes,
        "decisions": scenes,
        "config": scenes,
        "figures": scenes,
    }
    known = sum(scene["source"] == "courtyard" for scene in config["scenes"].values())
    for suffix, count in {"": scenes - known, "_courtyard": known}.items():
        jobs[f"tables{suffix}"] = count
        jobs[f"decompose{suffix}"] = count * (rows + len(staged))
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
    # One of the seeds and lengths stands for all.
    config.pop("vary", None)
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
    if any("changes" in m for m in config.get("methods", {}).values()):
        # Methods that begin alike share trainings: the test below.
        assert jobs["correct_poses"] > 0
        return
    wanted = expected_jobs(config)
    assert {rule: jobs.get(rule) for rule in wanted} == wanted


@pytest.mark.parametrize(("name", "trainings"), [("high", 10 * 4), ("low", 5 * 7)])
def test_the_papers_tables_are_planned(name, trainings, root, tmp_path, snakemake):
    config = yaml.safe_load((root / f"workflow/config/outdoor_{name}.yaml").read_text())
    for scene in config["scenes"].values():
        scene["path"] = "photos"
    for scene in [*config["scenes"], *(f"{s}_x4" for s in config["scenes"])]:
        (tmp_path / "other" / scene).mkdir(parents=True, exist_ok=True)
    (tmp_path / "photos").mkdir()
    # The paper's high-frequency loss and its third metric are asked for.
    (tmp_path / "weights").mkdir()
    for path in (config["frequency_weights"], config["lpips"]["vgg"]):
        (tmp_path / path).touch()
    config["methods"]["other"] = {"renders": "other/{scene}"}
    written = write(tmp_path, config)
    code, output = snakemake(tmp_path, "comparison", "-n", "--configfile", written)
    assert code == 0, output
    jobs = jobs_of(output)
    scenes = 10 if name == "high" else 5
    rows = trainings + scenes
    assert (jobs["train"], jobs["finetune"], jobs["comparison"]) == (
        trainings,
        scenes,
        1,
    )
    # Another program's renders are scored, not rendered.
    assert (jobs["render_views"], jobs["evaluate"]) == (rows, rows + scenes)


def test_the_configs_are_short():
    """They were 66 lines each where each had to be complete."""
    lines = sum(len(path.read_text().splitlines()) for path in CONFIGS)
    assert lines <= 32 * len(CONFIGS)


def test_rounds_of_cameras_learnt_cameras_and_exports_are_planned(
    tmp_path, demo, snakemake
):
    demo["methods"] = {
        "mipnerf360": {"model": "base", "rounds": 1},
        "moved": {"model": "base", "rounds": 2, "changes": "cameras"},
        "both": {"model": "base", "rounds": 2, "changes": "cameras_then_photos"},
        "joint": {"model": "base", "refine": {}},
        "aligned": {"model": "base", "align": {}},
        "alignerf": {"model": "base", "alignerf": {}},
        "corrected": {"model": "base", "alignerf": {}, "changes": "cameras"},
    }
    written = write(tmp_path, demo)
    code, output = snakemake(tmp_path, "--configfile", written, "-n", "all", "export")
    assert code == 0, output
    wanted = {
        # Rounds 0 and 1 of photos, 1 and 2 of cameras, and photos after the first.
        "train": 5,
        "train_refining": 1,
        "train_aligning": 1,
        "correct_poses": 2,
        # AligNeRF twice, once with cameras put right after the one pre-training.
        "pretrain": 1,
        "render_pretrained": 1,
        "align_pretrained": 1,
        "correct_pretrained": 1,
        "finetune": 2,
        "align_test_poses": 9,
        "evaluate": 9,
        "evaluate_aligned_pose": 9,
        "decompose_courtyard": 9,
        "export_cameras": 6,
        "export_photos": 3,
    }
    assert jobs_of(output).items() >= wanted.items()


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
    jobs = {"poses_courtyard": 1, "preflight": 1, "train": 2}
    jobs |= {"render_all_views": 1, "align_all": 1}
    output = snakemake(*options, file, "--cores", "200")[1]
    assert jobs_of(output) == jobs
    # However many cores there are, poses have all of this machine.
    threads = re.findall(r"threads: (\d+)", output)
    assert str(sources.WHOLE_MACHINE) in [*threads, "1"]
    code, output = snakemake(
        *options, "results/courtyard/mipnerf360/round01/timing.json"
    )
    assert code == 1
    assert "Traceback" not in output


def test_facts_decide_before_anything_is_trained_where_they_may(
    tmp_path, demo, snakemake
):
    demo["decide"] = True
    file = "results/courtyard/alignerf/round0/renders/test"
    options = (tmp_path, "-n", file, "--configfile", write(tmp_path, demo))
    jobs = {"poses_courtyard": 1, "pretrain": 1, "finetune": 1, "render_views": 1}
    jobs["preflight"] = 1
    facts = {"facts": 1, "decisions": 1}
    assert jobs_of(snakemake(*options)[1]) == jobs | facts
    # What says all itself waits for nothing.
    demo["decide"] = False
    write(tmp_path, demo)
    assert jobs_of(snakemake(*options)[1]) == jobs


@pytest.mark.parametrize("accelerator", [False, True])
def test_what_trains_has_the_accelerator_alone_or_half_of_the_cores(
    tmp_path, monkeypatch, accelerator
):
    monkeypatch.setattr(machine, "has_accelerator", lambda: accelerator)
    try:
        for cores, wanted in ((1, 1), (2, 1), (5, 2), (64, 4)):
            monkeypatch.setattr(machine, "cores", lambda cores=cores: cores)
            importlib.reload(sources)
            assert cores == sources.WHOLE_MACHINE
            assert (cores if accelerator else wanted) == sources.OF_TRAINING
            assert accelerator == sources.ACCELERATORS
    finally:
        monkeypatch.undo()
        importlib.reload(sources)


def test_both_splits_are_rendered_where_something_follows(tmp_path, demo, snakemake):
    """Round 2 is the last: its training views are nobody's."""
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-n")
    folder = "results/courtyard/mipnerf360/round{}/displacement_{}.csv"
    for k, rule in ((1, "align_all"), (2, "align")):
        jobs = jobs_of(snakemake(*options, folder.format(k, "test"))[1])
        assert jobs[rule] == (2 if k == 1 else 1)
    assert snakemake(*options, folder.format(1, "train"))[0] == 0
    code, output = snakemake(*options, folder.format(2, "train"))
    assert code == 1
    assert "MissingRuleException" in output


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
    assert not {"train", "figures", "tables_courtyard"} & jobs.keys()
    jobs = jobs_of(snakemake(*options, "regimes")[1])
    # Unwarped, the method, warped once and twice; and the reference's other model.
    assert (jobs["regimes"], jobs["evaluate"], jobs["train"]) == (1, 4, 3 + 3)
    assert not {"tables_courtyard", "figures", "decompose_courtyard"} & jobs.keys()


def test_what_the_readme_prints_needs_no_number_of_cores(tmp_path, snakemake):
    code, output = snakemake(tmp_path, "--rulegraph")
    assert code == 0, output
    assert "digraph" in output
    assert "train" in output
    code, output = snakemake(tmp_path, "--lint")
    assert code == 0, output


def test_a_plan_asks_each_job_little(tmp_path):
    """Calls, not seconds, which depend on the machine. Of 275 a job 105 are left."""
    written = write(tmp_path, planning.config_of(scenes=5))
    command = [sys.executable, "-m", "cProfile", "-o", tmp_path / "profile"]
    command += ["-m", "snakemake", "--snakefile", ROOT / "Snakefile"]
    command += ["--configfile", written, "-n", "--quiet", "rules"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = pstats.Stats(str(tmp_path / "profile")).stats
    ours = str(ROOT / "alignerf" / "experiment")
    calls = sum(n for (path, *_), (_, n, *_) in found.items() if path.startswith(ours))
    jobs = sum(jobs_of(done.stdout + "\n\n").values())
    assert jobs == 5 * 70 + 1
    assert calls / jobs < 2 * 105
