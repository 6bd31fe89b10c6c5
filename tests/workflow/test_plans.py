"""Plans of every config, and targets by name."""

import importlib
import pstats
import re
import subprocess
import sys
import types
from pathlib import Path

import pytest
import yaml

from alignerf.experiment import sources
from alignerf.experiment.tables import scenes, shipped
from alignerf.io import machine

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = sorted((ROOT / "workflow" / "config").rglob("*.yaml"))
# Keys of a method that change no training of it.
BESIDE = ("published", "lengths")
# Trainings of each target at the paper's size.
AT_FULL_SIZE = {"table1": 8, "table2": 95, "table3": 60, "table4": 8, "figures": 13}
# Of the others there are targets.
OF_USERS = [path for path in CONFIGS if path.stem not in ("demo", *shipped.NAMES)]
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
    config = yaml.safe_load(path.read_text())
    full_size = config.pop("full_size", {})
    config.pop("small", None)
    return config if small else config | full_size


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
        "collect": collected_of(config),
        "draw": scenes,
    }


def expected_files(config):
    """Of every training its scores and parts; what needs a truth, where it is known."""
    scenes, staged, _, plain = counts_of(config)
    known = sum(scene["source"] == "courtyard" for scene in config["scenes"].values())
    looked_at = scenes * (plain + staged) - shared_of(config)
    return {
        "/metrics.csv": looked_at,
        "/decomposition_test.csv": looked_at,
        **dict.fromkeys(("/scores.csv", "/trainings.csv"), collected_of(config)),
        "/tables/misalignment.csv": scenes,
        "/tables/ranking.csv": known,
    }


def collected_of(config):
    """How many scenes' rows are collected: those of a published table once more."""
    return counts_of(config)[0] * (1 + ("published_table" in config))


def counts_of(config):
    """Scenes; of each its staged methods, their models, and all other trainings."""
    default = {"mipnerf360": {"rounds": 2}, "alignerf": {"alignerf": {}}}
    methods = config.get("methods", default).values()
    # Crops of a scene are made for its verdict, or by name.
    scenes = sum("crop" not in scene for scene in config["scenes"].values())
    others = {"alignerf", "align"}
    # Methods that differ in their rounds, or in what they are called, share them.
    plain = {}
    for method in (m for m in methods if not others & m.keys()):
        kind = {k: v for k, v in method.items() if k not in ("rounds", *BESIDE)}
        plain.setdefault(repr(kind), []).append(method.get("rounds", 0))
    aligning = sum("align" in m for m in methods)
    trained = sum(max(rounds) + 1 for rounds in plain.values()) + aligning
    staged = [(m.get("model"), m.get("adjust")) for m in methods if "alignerf" in m]
    return scenes, len(staged), len(set(staged)), trained


def shared_of(config):
    """Trainings with adjusted cameras that equal one with the scene's, already so."""
    methods = config.get("methods", {}).values()
    scenes = config["scenes"].values()
    same = sum("crop" not in s and s.get("poses") == "adjusted" for s in scenes)
    return same * sum("adjust" in m for m in methods)


def some(cases):
    """One in four; `make tools` runs the others, too."""
    return [
        pytest.param(case, marks=pytest.mark.whole if k % 4 else ())
        for k, case in enumerate(cases)
    ]


@pytest.mark.parametrize("path", some(OF_USERS), ids=lambda path: path.stem)
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
    config["lpips"] = {"alex": "weights.npz", "vgg": None}
    written = write(tmp_path, config)
    code, output = dry_run(tmp_path, "--configfile", written, "-n")
    assert code == 0, output
    jobs = jobs_of(output)
    if any("changes" in m for m in config.get("methods", {}).values()):
        # Methods that begin alike share trainings: the test below.
        assert jobs["correct_poses"] > 0
        return
    check_plan(output, config)


def experiments_of(words, small=True):
    """What a command line of a shipped target makes, as a plan knows it."""
    given = shipped.configs({"small": small})
    return shipped.experiments(given, (), words)


def check_target(output, target, experiment, names):
    """That a dry run makes the files of a target, of scenes of these names."""
    jobs, own = jobs_of(output), [target, "arm"][target == "figures"]
    assert jobs[target] == jobs[own] == 1
    found = scenes.printed(experiment) if own.startswith("table") else names
    drawn = target == "figures"
    assert (jobs["collect"], jobs.get("draw", 0)) == (len(found) + drawn, drawn)
    assert made(output, f"results/{own}.csv") == {f"results/{own}.csv": 1}
    # Neither pages nor scenes' own tables.
    assert not jobs.keys() & {"page", "verdict", "tables", "all"}
    return jobs


@pytest.mark.parametrize("target", some(shipped.NAMES))
def test_a_target_of_the_papers_is_planned(target, tmp_path, photos_of_tables, dry_run):
    code, output = dry_run(tmp_path, target, "-n")
    assert code == 0, output
    experiment = experiments_of([target]).by_name[target]
    check_target(output, target, experiment, experiment.captures())


@pytest.mark.parametrize("target", some(AT_FULL_SIZE))
def test_the_papers_own_size_is_planned_without_its_data(
    target, tmp_path, photos_of_tables, dry_run
):
    code, output = dry_run(tmp_path, target, "-n", "--config", "small=false")
    assert code == 0, output
    experiment = experiments_of([target], small=False).by_name[target]
    jobs = check_target(output, target, experiment, experiment.captures())
    assert jobs["train"] == AT_FULL_SIZE[target]
    photos = {s.path for s in experiment.scenes.values() if s.path}
    fetched = {name: count for name, count in jobs.items() if "download" in name}
    assert fetched == {"download_scene": len(photos) or 1}
    assert not list(tmp_path.glob("**/360_v2*"))


def test_the_paper_is_all_of_its_targets(tmp_path, photos_of_tables, dry_run):
    code, output = dry_run(tmp_path, "paper", "-n")
    assert code == 0, output
    jobs = jobs_of(output)
    every = {"arm", "draw", "paper", "tradeoff", *shipped.TABLES}
    assert {name: jobs[name] for name in every} == dict.fromkeys(every, 1)
    assert not jobs.keys() & {"page", "verdict", "tables", "comparison", "courtyard"}


def test_a_scene_narrows_a_table(tmp_path, photos_of_tables, dry_run):
    code, output = dry_run(tmp_path, "table1", "courtyard_colmap", "-n")
    assert code == 0, output
    # With all its seeds, and without a page of its own.
    jobs = jobs_of(output)
    assert (jobs["table1"], jobs["collect"]) == (1, 3)
    assert "page" not in jobs
    assert "courtyard_off" not in output
    code, output = dry_run(tmp_path, "table1", "fox_small", "-n")
    assert code == 1
    reason = "error: fox_small: no scene of table1; theirs: courtyard_off, "
    assert (output.count("\n"), output[: len(reason)]) == (1, reason)


def test_without_their_photos_tables_stop_nobody_else(tmp_path, dry_run, monkeypatch):
    monkeypatch.setenv("ALIGNERF_DATA", str(tmp_path / "none"))
    code, output = dry_run(tmp_path, "courtyard", "-n")
    assert code == 0, output
    # What is told is of the demo.
    (warning,) = re.findall("^warning: .*", output, re.M)
    assert "no column lpips_alex" in warning
    code, output = dry_run(tmp_path, "table3", "-n")
    assert code == 1
    assert "error: config: scenes.treehill_small.path: " in output


def test_both_sizes_have_results_of_their_own():
    """Else the small one begins with replacing what took weeks."""
    for path in IN_TWO_SIZES:
        both = [sized(path, small) for small in (True, False)]
        assert not both[0]["scenes"].keys() & both[1]["scenes"].keys(), path


def test_photos_that_are_there_are_no_rules_output(
    tmp_path, root, dry_run, monkeypatch
):
    """Else `--forceall` and `--delete-all-output` deleted them, or a broken link."""
    monkeypatch.delenv("ALIGNERF_DATA", raising=False)
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
    part = tmp_path / "360_v2" / "360_extra_scenes.zip.fetched"
    part.write_bytes(b"PK")
    more = {"https_proxy": "http://127.0.0.1:9", "ALIGNERF_DATA": str(tmp_path)}
    code, output = snakemake(tmp_path, "download_360_v2", "--cores", "1", more=more)
    assert code == 1
    assert re.search(r"^error: https://\S+\.zip: curl ended with \d+", output, re.M)
    assert (tmp_path / "360_v2" / "flowers").is_dir()
    assert part.read_bytes() == b"PK"


def test_the_index_has_every_config_and_no_other(root):
    text = (root / "workflow/config/README.md").read_text()
    listed = re.findall(r"^\| `(\w+\.yaml)` \|", text, re.MULTILINE)
    assert sorted(listed) == sorted(path.name for path in CONFIGS)


def test_the_configs_are_short():
    """They were 66 lines each where each had to be complete."""
    lines = sum(len(path.read_text().splitlines()) for path in CONFIGS)
    assert lines <= 33 * len(CONFIGS)


def test_rounds_of_cameras_learnt_cameras_and_exports_are_planned(
    tmp_path, demo, dry_run
):
    demo["methods"] = {
        "mipnerf360": {"model": "base", "rounds": 1},
        "moved": {"model": "base", "rounds": 2, "changes": "cameras"},
        "joint": {"model": "base", "pose_optimization": {}},
        "aligned": {"model": "base", "align": {}},
        "alignerf": {"model": "base", "alignerf": {}},
    }
    written = write(tmp_path, demo)
    code, output = dry_run(tmp_path, "--configfile", written, "-n", "all", "export")
    assert code == 0, output
    wanted = {
        # Rounds 0 and 1 of photos, 1 and 2 of cameras; one that learns cameras, one
        # that aligns itself; and AligNeRF after its pre-training.
        "train": 4 + 1 + 1 + 1 + 1,
        **dict.fromkeys(("render", "align", "align_test_poses"), 7),
        "correct_poses": 2,
    }
    assert jobs_of(output).items() >= wanted.items()
    files = {
        **dict.fromkeys(("/metrics.csv", "/metrics_aligned_pose.csv"), 7),
        "/decomposition_test.csv": 7,
        "/export/cameras": 4,
        "/export/photos": 2,
    }
    assert made(output, *files) == files


def test_without_arguments_the_demo_is_planned(tmp_path, root, snakemake, dry_run):
    code, output = snakemake(tmp_path, "-n", more={"VERBOSE": "1"})
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


@pytest.mark.parametrize("accelerators", [0, 1, 8])
def test_what_trains_has_the_accelerators_alone_or_half_of_the_cores(
    monkeypatch, accelerators
):
    monkeypatch.setattr(machine, "accelerators", lambda: accelerators)
    try:
        for cores, wanted in ((1, 1), (2, 1), (5, 2), (64, 4)):
            monkeypatch.setattr(machine, "cores", lambda cores=cores: cores)
            importlib.reload(sources)
            assert cores == sources.WHOLE_MACHINE
            assert (cores if accelerators else wanted) == sources.OF_TRAINING
        for gpus, wanted in (("all", accelerators), (1, min(accelerators, 1))):
            assert sources.gpus(types.SimpleNamespace(gpus=gpus)) == wanted
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


@pytest.mark.whole
def test_what_the_readme_prints_needs_no_number_of_cores(tmp_path, snakemake):
    code, output = snakemake(tmp_path, "--rulegraph")
    assert code == 0, output
    assert "digraph" in output
    assert "train" in output
    code, output = snakemake(tmp_path, "--lint")
    assert code == 0, output


STAGES = ("train", "render_views", "align_test_poses", "evaluate", "tabulate")
STAGES = (*(f"alignerf.{name}" for name in STAGES), "alignerf.tables.collect")
STAGES += tuple(f"flow.{name}" for name in ("align", "decompose", "control_sets"))
STAGES += ("flow.figures.scene", "alignerf.poses", "alignerf.config")
# Of what reads a job, and a config with its methods.
JOBS = {"train", "render_views", "align_test_poses", "alignerf.config"}


@pytest.mark.parametrize(
    ("path", "stages"),
    [
        ("flow/figures/drawing.py", {"figures.scene"}),
        ("alignerf/tables/misalignment.py", {"tabulate"}),
        ("alignerf/tables/collect.py", {"collect"}),
        ("alignerf/metrics/lpips.py", {"evaluate"}),
        (
            "flow/__init__.py",
            {"align_test_poses", "align", "decompose", "control_sets", "figures.scene"},
        ),
        ("flow/warping/controls.py", {"align_test_poses", "control_sets"}),
        ("flow/camera/fit.py", {"align_test_poses", "decompose"}),
        ("alignerf/experiment/jobs.py", JOBS),
    ],
)
def test_a_source_is_of_the_stages_that_run_it(path, stages):
    """Whose sources change run again (tests/workflow/test_chain.py)."""
    found = {one for one in STAGES if ROOT / path in sources.reached(one)}
    assert found == {one for one in STAGES if one.endswith(tuple(stages))}


@pytest.mark.whole
def test_a_plan_asks_each_job_little(tmp_path):
    """Calls, not seconds, which depend on the machine: 282 a job, 97 to begin with."""
    found = sized(ROOT / "workflow/config/table4.yaml")
    (scene,) = found["scenes"].values()
    copies = {f"scene_{k}": dict(scene) for k in range(5)}
    kept = {key: value for key, value in found.items() if key != "vary"}
    written = write(tmp_path, kept | {"scenes": copies})
    command = [sys.executable, "-m", "cProfile", "-o", tmp_path / "profile"]
    command += ["-m", "snakemake", "--snakefile", ROOT / "Snakefile"]
    command += ["--configfile", written, "-n", "--quiet", "rules"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = pstats.Stats(str(tmp_path / "profile")).stats
    ours = str(ROOT / "alignerf" / "experiment")
    calls = sum(n for (path, *_), (_, n, *_) in found.items() if path.startswith(ours))
    jobs = sum(jobs_of(done.stdout + "\n\n").values())
    assert jobs == 5 * 57 + 2
    assert calls / jobs < 300
