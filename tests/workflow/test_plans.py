"""Plans of every config, and targets by name."""

import importlib
import pstats
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from alignerf.experiment import check, sources
from alignerf.io import machine
from tools.bench import planning

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = sorted((ROOT / "workflow" / "config").rglob("*.yaml"))
IN_TWO_SIZES = [path for path in CONFIGS if "\nfull_size:" in path.read_text()]


def write(folder, config):
    path = folder / "config.yaml"
    path.write_text(yaml.safe_dump(config, sort_keys=False))
    return path


def jobs_of(output):
    """{rule: number of jobs} of a dry run."""
    table = output.split("Job stats:")[1].split("\n\n")[0]
    jobs = dict(re.findall(r"^([\w.-]+) +(\d+)$", table, re.MULTILINE))
    return {rule: int(count) for rule, count in jobs.items() if rule != "total"}


def made(output, *endings):
    """{ending: number of files, or folders, that the jobs of a dry run make}."""
    found = re.findall(r"^    output: (.*)$", output, re.MULTILINE)
    paths = [
        path.removesuffix(" (update)") for line in found for path in line.split(", ")
    ]
    return {end: sum(path.endswith(end) for path in paths) for end in endings}


def check_plan(output, config):
    """That a dry run has what `expected_jobs` and `expected_files` say."""
    jobs, files = expected_jobs(config), expected_files(config)
    assert jobs_of(output).items() >= jobs.items()
    assert made(output, *files) == files


def sized(path, small=True):
    """A config in one of its sizes."""
    return check.sized(yaml.safe_load(path.read_text()) | {"small": small})


def expected_jobs(config):
    """The trainings of a config by the paper's scheme, and what each one entails."""
    scenes, staged, models, plain = counts_of(config)
    shared = shared_of(config)
    # Crops: as given, and with cameras corrected; each is trained once.
    methods = config.get("methods", {}).values()
    corrected = any({"align", "auto"} & m.keys() for m in methods)
    sets = scenes * (1 + corrected) * ("crops" in config)
    named = sum("crop" in scene for scene in config["scenes"].values())
    return {
        # Staged methods of a model share the first of their two trainings.
        "train": scenes * (plain + models + staged) + sets + named - shared,
        "render": scenes * (plain + staged) + sets + named - shared,
        "align": scenes * (plain + staged) + sets + named - shared,
        "testset": scenes,
        "control_sets": scenes,
        "facts": scenes + sets + named * config.get("decide", False),
        "config": scenes,
        "collect": scenes,
        "figures": scenes,
    }


def expected_files(config):
    """Of every training its scores and parts; what needs a truth, where it is known."""
    scenes, staged, _, plain = counts_of(config)
    known = sum(scene["source"] == "courtyard" for scene in config["scenes"].values())
    looked_at = scenes * (plain + staged) - shared_of(config)
    return {
        "/metrics.csv": looked_at,
        "/decomposition_test.csv": looked_at,
        **dict.fromkeys(("/scores.csv", "/trainings.csv"), scenes),
        "/tables/misalignment.csv": scenes,
        "/tables/ranking.csv": known,
    }


def counts_of(config):
    """Scenes; of each its staged methods, their models, and all other trainings."""
    default = {"mipnerf360": {"rounds": 2}, "alignerf": {"alignerf": {}}}
    methods = config.get("methods", default).values()
    # Crops of a scene are made for its verdict, or by name.
    scenes = sum("crop" not in scene for scene in config["scenes"].values())
    others = {"alignerf", "warm_start", "align"}
    plain = [m.get("rounds", 0) for m in methods if not others & m.keys()]
    aligning = sum("align" in m for m in methods)
    warm = [m["rounds"] for m in methods if "warm_start" in m]
    trained = sum(rounds + 1 for rounds in plain) + sum(warm) + aligning
    staged = [(m.get("model"), m.get("adjust")) for m in methods if "alignerf" in m]
    return scenes, len(staged), len(set(staged)), trained


def shared_of(config):
    """Trainings with adjusted cameras that equal one with the scene's, already so."""
    methods = config.get("methods", {}).values()
    scenes = config["scenes"].values()
    same = sum("crop" not in s and s.get("poses") == "adjusted" for s in scenes)
    return same * sum("adjust" in m for m in methods)


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_config_can_be_planned(path, tmp_path, dry_run):
    config = sized(path)
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
    code, output = dry_run(tmp_path, "--configfile", written, "-n")
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
    check_plan(output, config)


@pytest.mark.parametrize("path", IN_TWO_SIZES, ids=lambda path: path.stem)
def test_the_papers_own_size_is_planned_without_its_data(path, tmp_path, dry_run):
    options = ("--configfile", path, "--config", "small=false")
    code, output = dry_run(tmp_path, "all", "-n", *options)
    assert code == 0, output
    own = {
        Path(s["path"]).name
        for s in sized(path, False)["scenes"].values()
        if "path" in s
    }
    jobs = jobs_of(output).items()
    fetched = {name: count for name, count in jobs if name.startswith("download")}
    # Of the VGG-19 for the loss, and of LPIPS' VGG-16.
    wanted = {"download_scene": len(own), "download_weights": 2} if own else {}
    assert fetched == wanted
    assert not list(tmp_path.glob("360_v2*"))


def test_both_sizes_have_results_of_their_own():
    """Else the small one begins with replacing what took weeks."""
    for path in IN_TWO_SIZES:
        both = [sized(path, small) for small in (True, False)]
        assert not both[0]["scenes"].keys() & both[1]["scenes"].keys(), path
        assert both[0].get("regimes", "a") != both[1].get("regimes", "b"), path


def test_photos_that_are_there_are_no_rules_output(tmp_path, root, dry_run):
    """Else `--forceall` and `--delete-all-output` deleted them, or a broken link."""
    (tmp_path / "360_v2" / "bicycle").mkdir(parents=True)
    (tmp_path / "360_v2" / "garden").symlink_to(tmp_path / "unmounted")
    path = root / "workflow/config/table4.yaml"
    options = ("--configfile", path, "--config", "small=false")
    code, output = dry_run(tmp_path, "all", "-n", "--forceall", *options)
    assert code == 0, output
    # Of the others that table4.yaml has, none is there.
    assert "360_v2/bicycle" not in re.findall(r"output: (\S+)", output)
    code, output = dry_run(tmp_path, "download_360_v2", "-n", *options)
    names = ("360_v2/bicycle", "360_v2/garden", "360_v2/treehill")
    assert list(made(output, *names).values()) == [0, 0, 1]


def test_a_stopped_download_keeps_what_is_there(tmp_path, snakemake):
    """Of a failing job Snakemake deletes the outputs: of that scene, and no other's."""
    (tmp_path / "360_v2" / "flowers").mkdir(parents=True)
    part = tmp_path / "360_v2" / "360_extra_scenes.zip"
    part.write_bytes(b"PK")
    more = {"https_proxy": "http://127.0.0.1:9"}
    code, output = snakemake(tmp_path, "download_360_v2", "--cores", "1", more=more)
    assert code == 1
    assert re.search(
        r"^error: https://.*360_v2/\w+\.zip, or the scene to", output, re.M
    )
    assert (tmp_path / "360_v2" / "flowers").is_dir()
    assert part.read_bytes() == b"PK"


@pytest.mark.parametrize(("number", "trainings"), [(2, 10 * 4), (3, 5 * 7)])
def test_the_papers_tables_are_planned(number, trainings, root, tmp_path, dry_run):
    config = sized(root / f"workflow/config/table{number}.yaml", small=False)
    for scene in [*config["scenes"], *(f"{s}_x4" for s in config["scenes"])]:
        (tmp_path / "other" / scene).mkdir(parents=True, exist_ok=True)
    config["methods"]["other"] = {"renders": "other/{scene}"}
    written = write(tmp_path, config)
    code, output = dry_run(tmp_path, "comparison", "-n", "--configfile", written)
    assert code == 0, output
    jobs = jobs_of(output)
    scenes = 10 if number == 2 else 5
    rows = trainings + scenes
    # And a pre-training of each fine-tuning, which nobody looks at.
    assert (jobs["train"], jobs["comparison"]) == (rows + scenes, 1)
    files = ("/comparison/scores.csv", "/comparison/trainings.csv")
    assert made(output, *files) == dict.fromkeys(files, scenes)
    assert jobs["collect"] == scenes
    # Another program's renders are scored, not rendered.
    assert (jobs["render"], made(output, "/metrics.csv")) == (
        rows,
        {"/metrics.csv": rows + scenes},
    )


def test_the_index_has_every_config_and_no_other(root):
    text = (root / "workflow/config/README.md").read_text()
    listed = re.findall(r"^\| `(\w+\.yaml)` \|", text, re.MULTILINE)
    assert sorted(listed) == sorted(path.name for path in CONFIGS)


def test_the_configs_are_short():
    """They were 66 lines each where each had to be complete."""
    lines = sum(len(path.read_text().splitlines()) for path in CONFIGS)
    assert lines <= 32 * len(CONFIGS)


def test_rounds_of_cameras_learnt_cameras_and_exports_are_planned(
    tmp_path, demo, dry_run
):
    demo["methods"] = {
        "mipnerf360": {"model": "base", "rounds": 1},
        "moved": {"model": "base", "rounds": 2, "changes": "cameras"},
        "both": {"model": "base", "rounds": 2, "changes": "cameras_then_photos"},
        "joint": {"model": "base", "pose_optimization": {}},
        "aligned": {"model": "base", "align": {}},
        "alignerf": {"model": "base", "alignerf": {}},
        "corrected": {"model": "base", "alignerf": {}, "changes": "cameras"},
    }
    written = write(tmp_path, demo)
    code, output = dry_run(tmp_path, "--configfile", written, "-n", "all", "export")
    assert code == 0, output
    wanted = {
        # Rounds 0 and 1 of photos, 1 and 2 of cameras, and photos after the first;
        # one that learns cameras, one that aligns itself; and AligNeRF twice, once
        # with cameras corrected after the one pre-training.
        "train": 5 + 1 + 1 + 1 + 2,
        "render": 9 + 1,
        "align": 9 + 1,
        "correct_poses": 2 + 1,
        "align_test_poses": 9,
    }
    assert jobs_of(output).items() >= wanted.items()
    files = {
        **dict.fromkeys(("/metrics.csv", "/metrics_aligned_pose.csv"), 9),
        "/decomposition_test.csv": 9,
        "/export/cameras": 6,
        "/export/photos": 3,
    }
    assert made(output, *files) == files


def test_without_arguments_the_demo_is_planned(tmp_path, root, snakemake, dry_run):
    code, output = snakemake(tmp_path, "-n")
    assert code == 0
    demo = root / "workflow/config/demo.yaml"
    check_plan(output, yaml.safe_load(demo.read_text()))
    assert not (tmp_path / "results").exists()
    # The quicker way of the other tests plans the same, job by job.
    code, other = dry_run(tmp_path, "-n")
    assert (code, said_of_jobs(other)) == (0, said_of_jobs(output))


def said_of_jobs(output):
    """What a dry run says of its jobs, but times: lines, and their words, sorted."""
    lines = output[output.index("Job stats:") :].splitlines()
    kept = [line for line in lines if not line.startswith("[")]
    return sorted(sorted(re.findall(r"[^\s,;]+", line)) for line in kept)


def test_a_scene_or_a_file_by_name(tmp_path, demo, dry_run):
    demo["scenes"]["my-yard.1"] = demo["scenes"]["courtyard"]
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-n")
    both, one = (jobs_of(dry_run(*options, *t)[1]) for t in ([], ["my-yard.1"]))
    assert one.pop("my-yard.1") == both.pop("all") == 1
    assert both == {rule: 2 * count for rule, count in one.items()}
    file = "results/my-yard.1/mipnerf360/round1/timing.json"
    jobs = {"poses": 1, "train": 2}
    jobs |= {"render": 1, "align": 1}
    output = dry_run(*options, file, "--cores", "200")[1]
    assert jobs_of(output) == jobs
    # However many cores there are, poses have all of this machine.
    threads = re.findall(r"threads: (\d+)", output)
    assert str(sources.WHOLE_MACHINE) in [*threads, "1"]
    code, output = dry_run(*options, "results/courtyard/mipnerf360/round01/timing.json")
    assert code == 1
    assert "Traceback" not in output


def test_facts_decide_before_anything_is_trained_where_they_may(
    tmp_path, demo, dry_run
):
    demo["decide"] = True
    file = "results/courtyard/alignerf/round0/renders"
    options = (tmp_path, "-n", file, "--configfile", write(tmp_path, demo))
    jobs = {"poses": 1, "train": 2, "render": 1}
    facts = {"facts": 1}
    assert jobs_of(dry_run(*options)[1]) == jobs | facts
    # What says all itself waits for nothing.
    demo["decide"] = False
    write(tmp_path, demo)
    assert jobs_of(dry_run(*options)[1]) == jobs


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


def test_both_splits_are_rendered_where_something_follows(tmp_path, demo, dry_run):
    """Round 2 is the last: its training views are nobody's."""
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-n", "-p")
    folder = "results/courtyard/mipnerf360/round{}"
    code, output = dry_run(*options, f"{folder.format(2)}/displacement")
    assert code == 0, output
    assert jobs_of(output).items() >= {"train": 3, "render": 3, "align": 3}.items()
    for module in ("alignerf.render_views", "flow.align"):
        commands = re.findall(rf"python -m {module} .*", output)
        for k, splits in enumerate(("train test", "train test", "test")):
            (command,) = (c for c in commands if f"{folder.format(k)}/renders" in c)
            assert re.search(r"--splits ([a-z ]+) --", command)[1] == splits
    # What would be of no use to anybody cannot be asked for.
    code, output = dry_run(*options, f"{folder.format(2)}/flow/train")
    assert code == 1
    assert "MissingRuleException" in output


def test_the_regimes_make_their_own_jobs_and_no_others(tmp_path, demo, dry_run):
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-n")
    others = ("/tables/misalignment.csv", "/decomposition_test.csv")
    output = dry_run(*options, "regimes")[1]
    jobs = jobs_of(output)
    # Unwarped, the method in its two stages, warped once and twice; and the
    # reference's other model.
    assert (jobs["regimes"], jobs["evaluate"], jobs["train"]) == (1, 4, 3 + 2 + 3)
    assert (jobs["collect"], made(output, "/regimes/trainings.csv")) == (
        1,
        {"/regimes/trainings.csv": 1},
    )
    assert "figures" not in jobs
    assert made(output, *others) == dict.fromkeys(others, 0)


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
    assert jobs == 5 * 73 + 1
    assert calls / jobs < 2 * 105
