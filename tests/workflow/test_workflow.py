"""Plans of every config, and bad input: one line that names it, nothing half-made."""

import copy
import json
import os
import re
import runpy
import types
from pathlib import Path

import numpy as np
import pytest
import skimage.data
import yaml
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = sorted((ROOT / "workflow" / "config").glob("*.yaml"))


@pytest.fixture
def demo():
    return yaml.safe_load((ROOT / "workflow/config/demo.yaml").read_text())


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
    scenes, methods = len(config["scenes"]), config["methods"].values()
    plain = [m["rounds"] for m in methods if not {"alignerf", "warm_start"} & m.keys()]
    warm = [m["rounds"] for m in methods if "warm_start" in m]
    rows = sum(rounds + 1 for rounds in plain) + sum(warm)
    staged = [m["model"] for m in methods if "alignerf" in m]
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
    if any(method["rounds"] == "auto" for method in config["methods"].values()):
        # What follows is known when the flow of round 0 is.
        assert jobs["decide"] == len(config["scenes"])
        return
    wanted = expected_jobs(config)
    assert {rule: jobs.get(rule) for rule in wanted} == wanted


def test_without_arguments_the_demo_is_planned(tmp_path, demo, snakemake):
    code, output = snakemake(tmp_path, "-n")
    assert code == 0
    assert {"train", "align", "evaluate", "render_views"} <= jobs_of(output).keys()
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
    assert jobs_of(snakemake(*options, file)[1]) == jobs
    code, output = snakemake(
        *options, "results/courtyard/mipnerf360/round01/timing.json"
    )
    assert code == 1
    assert "Traceback" not in output


def test_configs_that_share_results_agree_on_them():
    """matching.yaml is of ablation.yaml's scenes, choices.yaml of another seed."""
    ablation, matching, choices = (
        yaml.safe_load((ROOT / f"workflow/config/{name}.yaml").read_text())
        for name in ("ablation", "matching", "choices")
    )
    left_out = ("methods", "regimes")
    shared = {k: v for k, v in ablation.items() if k not in left_out}
    assert {k: v for k, v in matching.items() if k not in left_out} == shared
    for name in ("convolution", "alignment"):
        assert matching["methods"][name] == ablation["methods"][name]
    other = {k: v for k, v in choices.items() if k not in left_out}
    assert other == shared | {
        "seed": 1,
        "scenes": {"choices": ablation["scenes"]["ablation"]},
    }
    chosen = choices["methods"]["features_16"]
    assert chosen == ablation["methods"]["alignment"]
    seeds = {scene.get("seed", 0) for scene in ablation["scenes"].values()}
    assert choices["seed"] not in seeds


def test_ablations_share_the_pretraining(tmp_path, demo, snakemake):
    ablation = copy.deepcopy(demo["methods"]["alignerf"])
    ablation["alignerf"] |= {"finetune_share": 0.1, "patches": 1, "features": 3}
    ablation["alignerf"]["align_penalty"] = 0
    demo["methods"]["ablation"] = ablation
    options = ("--configfile", write(tmp_path, demo), "-n")
    jobs = jobs_of(snakemake(tmp_path, *options)[1])
    assert (jobs["pretrain"], jobs["finetune"]) == (1, 2)
    ablation["alignerf"]["pretrain_share"] = 0.5
    write(tmp_path, demo)
    code, output = snakemake(tmp_path, *options)
    assert code == 1
    assert "Traceback" not in output
    reason = "error: config: methods alignerf, ablation disagree about base's pretrain"
    assert output.splitlines()[-1].startswith(reason)


def test_a_scene_has_its_own_seed_and_steps(tmp_path, demo, snakemake):
    demo["scenes"]["other"] = demo["scenes"]["courtyard"] | {"seed": 5, "steps": 70}
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-np", "other")
    output = snakemake(*options)[1]
    (poses,) = re.findall(r"python -m alignerf\.poses .*", output)
    assert '"seed": 5' in poses
    # How long it is trained is nothing to its poses.
    assert '"steps"' not in poses
    for command in re.findall(r"python -m alignerf\.train .*", output):
        assert '"seed": 5' in command
        assert '"steps": 70' in command
        assert '"warmup_steps": 7' in command
    demo["tradeoff"]["scene"] = "other"
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-np", "tradeoff")
    commands = re.findall(r"python -m alignerf\.train .*", snakemake(*options)[1])
    (base,) = (c for c in commands if "tradeoff/base/model" in c)
    assert '"seed": 5' in base
    assert '"steps": 70' in base


def test_a_radius_is_measured_where_it_is_asked_for(tmp_path, demo, snakemake):
    demo["methods"]["alignerf"]["alignerf"]["radius_px"] = "auto"
    demo["methods"]["mipnerf360"]["rounds"] = 0
    path = "results/courtyard/alignerf/round0/timing.json"
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-np", path)
    output = snakemake(*options)[1]
    measured = "results/courtyard/mipnerf360/round0/displacement_train.csv"
    (command,) = re.findall(r"python -m alignerf\.train .*--displacement.*", output)
    assert f"--displacement {measured}" in command
    assert '"radius_px": null' in command
    assert {"align": 1, "train": 1}.items() <= jobs_of(output).items()
    output = snakemake(*options[:-1], "results/courtyard/tables/misalignment.csv")[1]
    (rows,) = re.findall(r"python -m alignerf\.tables --rows '(.*)' --csv", output)
    (row,) = (row for row in json.loads(rows) if row["method"] == "alignerf")
    assert measured in row["data"]


def test_regimes_need_the_test_sets_and_no_other_table(tmp_path, demo, snakemake):
    demo["scenes"]["again"] = demo["scenes"]["courtyard"] | {"seed": 1}
    demo["methods"].pop("mipnerf360_large")
    demo["reference"] = {"method": "mipnerf360", "round": 0}
    # Neither where a method stands nor one of another model changes the rows.
    demo["methods"] = {
        "warm": {"model": "base", "rounds": 1, "warm_start": WARM},
        "other": {"model": "large", "rounds": "auto"},
    } | demo["methods"]
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-np", "regimes")
    output = snakemake(*options)[1]
    jobs = jobs_of(output)
    # Of each scene: unwarped, the method, warped once and twice, and once from there.
    assert (jobs["regimes"], jobs["evaluate"]) == (1, 2 * 5)
    assert (jobs["pretrain"], jobs["finetune"]) == (2, 2)
    assert (jobs["train"], jobs["train_warm"]) == (2 * 3, 2)
    assert not {"misalignment_table", "figures", "decompose"} & jobs.keys()
    (rows,) = re.findall(r"python -m alignerf\.regimes --rows '(.*)' --csv", output)
    scenes = json.loads(rows)
    assert [s["scene"] for s in scenes] == ["courtyard", "again"]
    assert [s["seed"] for s in scenes] == [0, 1]
    assert scenes[0]["alike"] == scenes[1]["alike"]
    assert [(m["method"], m["round"]) for m in scenes[0]["methods"]] == [
        ("mipnerf360", 0),
        ("alignerf", 0),
        ("mipnerf360", 1),
        ("mipnerf360", 2),
        ("warm", 1),
    ]
    rendered = "results/courtyard/mipnerf360/round0/render_train.json"
    assert rendered in scenes[0]["methods"][2]["data"]
    assert {(s["perturb_px"], s["motion_m"], s["steps"]) for s in scenes} == {
        (1.5, 0.02, 1000)
    }


WARM = {"from": "mipnerf360", "share": 0.3, "learning_rates": [0.005, 0.001]}


def test_a_warm_start_goes_on_from_the_round_before(tmp_path, demo, snakemake):
    demo["methods"] = {
        "warm": {"model": "base", "rounds": 2, "warm_start": WARM},
        "mipnerf360": {"model": "base", "rounds": 1},
    }
    demo["reference"] = {"method": "warm", "round": 2}
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-np")
    output = snakemake(*options)[1]
    jobs = jobs_of(output)
    # Round 0 is the other method's: nothing is trained twice.
    assert (jobs["train"], jobs["train_warm"], jobs["evaluate"]) == (2, 2, 4)
    folder = "results/courtyard"
    commands = re.findall(r"python -m alignerf\.train .*", output)
    (first,) = (c for c in commands if f"--model {folder}/warm/round1/" in c)
    (second,) = (c for c in commands if f"--model {folder}/warm/round2/" in c)
    assert f"--initial {folder}/mipnerf360/round0/model.msgpack" in first
    assert f"--photos {folder}/mipnerf360/round0/warped/train" in first
    assert f"--initial {folder}/warm/round1/model.msgpack" in second
    assert f"--photos {folder}/warm/round1/warped/train" in second
    for part in (
        '"stage": "warm"',
        '"steps": 300',
        '"warmup_steps": 30',
        "[0.005, 0.001]",
    ):
        assert part in first
        assert part in second
    others = [c for c in commands if c not in (first, second)]
    assert not any("--initial" in c or '"warm"' in c for c in others)


def test_rounds_end_where_the_flow_does(tmp_path, demo, snakemake):
    demo["methods"] = {"auto": {"model": "base", "rounds": "auto", "most_rounds": 3}}
    demo["reference"] = {"method": "auto", "round": "last"}
    options = (tmp_path, "--configfile", write(tmp_path, demo))
    jobs = jobs_of(snakemake(*options, "-n")[1])
    assert (jobs["train"], jobs["decide"]) == (1, 1)


@pytest.mark.parametrize(
    ("goes_on", "last"),
    [([False], 0), ([True, True, False, True], 2), ([True] * 9, 3)],
)
def test_the_last_round_is_what_was_decided(tmp_path, demo, monkeypatch, goes_on, last):
    # The file sets search paths for the jobs.
    monkeypatch.setenv("PATH", os.environ["PATH"])
    monkeypatch.setenv("PYTHONPATH", "")
    demo["methods"] = {"auto": {"model": "base", "rounds": "auto", "most_rounds": 3}}
    for round, go_on in enumerate(goes_on):
        (tmp_path / f"{round}.json").write_text(json.dumps({"go_on": go_on}))

    def get(*, round, **place):
        assert place == {"scene": "courtyard", "method": "auto"}
        return types.SimpleNamespace(output=[tmp_path / f"{round}.json"])

    decide = types.SimpleNamespace(get=get)
    functions = load_rules(
        "common.smk",
        config=demo,
        ROOT=ROOT,
        checkpoints=types.SimpleNamespace(decide=decide),
    )
    assert functions["last_round"]("courtyard", "auto") == last
    rows = functions["all_rounds"]("courtyard")
    assert rows == [("auto", k) for k in range(last + 1)]


def test_a_sweep_trains_its_variants_and_nothing_else(tmp_path, demo, snakemake):
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-n", "tradeoff")
    jobs = jobs_of(snakemake(*options)[1])
    variants = demo["tradeoff"]["variants"]
    scales = {v["downscale"] for v in variants.values() if "downscale" in v}
    each = ("train_variant", "render_variant", "evaluate_variant")
    assert jobs == {
        "poses_courtyard": 1,
        "shrink": len(scales),
        **dict.fromkeys(each, 1 + len(variants)),
        "tradeoff": 1,
    }


def test_a_sweep_takes_its_job_from_the_config(tmp_path, demo, snakemake):
    demo["tradeoff"]["variants"] = {"small": {"downscale": 1.5, "steps": 70}}
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-np", "tradeoff")
    output = snakemake(*options)[1]
    (base, small) = re.findall(r"python -m alignerf\.train .*", output)
    if "tradeoff/base" in small:
        base, small = small, base
    folder = "results/courtyard"
    assert f"--scene {folder} --photos {folder}/images " in base
    folder += "/tradeoff/downscale-1.5"
    assert f"--scene {folder} --photos {folder}/images " in small
    assert ('"steps": 1000' in base, '"steps": 70' in small) == (True, True)
    renders = re.findall(r"python -m alignerf\.render_views .*", output)
    assert all("--scene results/courtyard " in command for command in renders)
    scores = re.findall(r"python -m alignerf\.evaluate .*", output)
    assert all("--truth results/courtyard/truth" in command for command in scores)
    assert not any("--testset" in command for command in scores)


def test_controls_know_the_truth_and_rows_their_base(tmp_path, demo, snakemake):
    (tmp_path / "photos").mkdir()
    own = {"source": "photos", "path": "photos", "poses": "colmap"}
    demo["scenes"]["own"] = own
    # Staged methods of a model that a plain one has, and of one that none has.
    demo["models"]["alone"] = demo["models"]["base"]
    demo["methods"]["staged_alone"] = demo["methods"]["alignerf"] | {"model": "alone"}
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-np")
    code, output = snakemake(*options)
    assert code == 0, output
    commands = re.findall(r"python -m flow\.control_sets .*", output)
    assert len(commands) == 2
    for command in commands:
        truth = "--truth results/courtyard/truth" in command
        assert truth == ("--out results/courtyard/testset" in command)
        reference = demo["reference"]
        folder = f"{reference['method']}/round{reference['round']}/renders/test"
        assert re.search(rf"--renders results/\w+/{folder} ", command)
    (rows,) = re.findall(r"alignerf\.tables --rows '(.*courtyard.*)' --csv", output)
    bases = {row["method"]: row["base_metrics"] for row in json.loads(rows)}
    assert bases == {
        method: f"results/courtyard/{base}/round0/metrics.csv"
        for method, base in {
            "mipnerf360_large": "mipnerf360_large",
            "mipnerf360": "mipnerf360",
            "alignerf": "mipnerf360",
            "staged_alone": "staged_alone",
        }.items()
    }
    crops = re.findall(r"flow\.crop_figure .*courtyard.*--methods '(.*)' --fig", output)
    compared = [entry["method"] for entry in json.loads(crops[0])]
    assert compared == ["mipnerf360", "staged_alone", "alignerf"]
    tables = re.findall(r"alignerf\.ranking_table .*--csv (\S+)", output)
    assert tables == ["results/courtyard/tables/ranking.csv"]


def test_without_a_sweep_in_the_config_it_says_so(tmp_path, demo, snakemake):
    del demo["tradeoff"]
    options = (tmp_path, "--configfile", write(tmp_path, demo), "-n")
    assert snakemake(*options)[0] == 0
    code, output = snakemake(*options, "tradeoff")
    assert code == 1
    assert output.splitlines()[-1].startswith("error: config: tradeoff: not there")


def test_a_variant_is_the_base_with_its_keys(demo):
    variant_of = load_rules()["variant_of"]
    sweep = demo["tradeoff"] = {"scene": "courtyard", "model": "base"}
    mlp = {"kind": "mlp", "width": 32}
    sweep["variants"] = variants = {
        "steps": {"steps": 50},
        "warm": {"steps": 50, "warmup_steps": 7},
        "small": {"downscale": 2, "seed": 5},
        "table": {"field": {"log2_entries": 9}, "samples": [4, 2]},
        "mlp": {"field": mlp, "learning_rates": [0.1, 0.01]},
    }
    before = copy.deepcopy(demo)
    base = variant_of(demo, "base")
    model, training = demo["models"]["base"], demo["training"]
    wanted = {"seed": 0, "downscale": 1, "model": model, "training": training}
    assert base == wanted
    found = {name: variant_of(demo, name) for name in variants}
    # The warm-up keeps its share of the steps: 100 of 1000.
    shorter = {"training": training | {"steps": 50, "warmup_steps": 5}}
    assert found["steps"] == base | shorter
    assert found["warm"]["training"]["warmup_steps"] == 7
    assert found["small"] == base | {"downscale": 2, "seed": 5}
    field = model["field"] | {"log2_entries": 9}
    changed = {"model": model | {"field": field, "samples": [4, 2]}}
    assert found["table"] == base | changed
    assert found["mlp"]["model"] == model | {"field": mlp}
    assert found["mlp"]["training"] == training | {"learning_rates": [0.1, 0.01]}
    assert demo == before


def edit(config, where, value):
    """Set, or for value None delete, the key at the dotted path."""
    *parents, last = where.split(".")
    for key in parents:
        config = config[int(key)] if isinstance(config, list) else config[key]
    # A dot of the key itself.
    last = last.replace("@", ".")
    if value is None:
        del config[last]
    else:
        config[int(last) if isinstance(config, list) else last] = value


@pytest.mark.parametrize(
    ("where", "value", "reason"),
    [
        ("training.stpes", 5, "training: .*'stpes' was unexpected"),
        ("models.base.field.levles", 5, r"models.base.field: .*'levles' was unexp"),
        ("models.base.field.kind", "gird", r"field.kind: 'gird' is not one of"),
        ("models.base.field.levels", "8", r"field.levels: '8' is not of type"),
        ("models.base.field.kind", None, "models.base.field: 'kind' is a required"),
        ("seed", None, "'seed' is a required"),
        ("seed", True, "seed: True is not of type 'integer'"),
        ("training.learning_rates.0", "1e-3", r"learning_rates.0: '1e-3' is not of"),
        ("training.batch_rays", 0, "training.batch_rays: 0 is less than"),
        ("flow.kernel", "sinc", "flow.kernel: 'sinc' is not one of"),
        ("flow.method", "files", "flow: 'folder' is a required"),
        ("flow.folder", "flows", "flow.folder: method 'deepflow' reads none"),
        ("methods.mipnerf360.model", "huge", r"methods.mipnerf360.model: no model 'hu"),
        ("methods.alignerf.rounds", 1, "methods.alignerf.rounds: 0 was expected"),
        ("methods.pretrain", {"model": "base", "rounds": 0}, "methods.pretrain: a fo"),
        ("methods.alignerf.alignerf.matching", "ray", "matching: 'ray' is not one of"),
        ("methods.alignerf.alignerf.radius_px", -1, "radius_px: -1 is less than"),
        ("regimes", "../x", "regimes: '../x' does not match"),
        ("methods.images", {"model": "base", "rounds": 0}, "methods.images: a folder"),
        ("models.base.near", 1e6, "models.base: near must be smaller than far"),
        ("scenes.published", {"source": "courtyard"}, "scenes.published: a rule or"),
        ("scenes.mine", {"source": "photos", "path": "a{b}"}, "scenes.mine.path: a{b}"),
        ("reference.method", "nerf", "reference.method: no method 'nerf'"),
        ("reference.round", 3, "reference.round: mipnerf360_large has fewer"),
        ("reference.round", "first", "reference.round: 'first' is not valid"),
        ("methods.mipnerf360.rounds", "all", "mipnerf360.rounds: 'all' is not valid"),
        ("methods.mipnerf360.warm_start", WARM, "warm_start.from: no method 'mipnerf3"),
        ("methods.alignerf.warm_start", WARM, "alignerf.warm_start: not for a staged"),
        (
            "methods.warm",
            {"model": "large", "rounds": 1, "warm_start": WARM},
            "warm.warm_start.from: model 'base' instead of 'large'",
        ),
        ("methods.mipnerf360.most_rounds", 2, "most_rounds: only with `rounds: auto`"),
        (
            "methods.warm",
            {"model": "base", "rounds": 0, "warm_start": WARM},
            "warm.rounds: a warm start needs a round",
        ),
        ("methods.mipnerf360_large.rounds", "auto", "reference.round: with rounds: au"),
        ("scenes.a/b", {"source": "courtyard"}, "scenes: 'a/b' does not match"),
        ("scenes.a\n", {"source": "courtyard"}, r"scenes: 'a\\n' does not match"),
        ("scenes.train", {"source": "courtyard"}, "scenes.train: a rule or file"),
        ("scenes.mine", {"source": "photos"}, "scenes.mine.path: source 'photos'"),
        ("frequency_weights", "no.npz", "frequency_weights: no.npz does not exist"),
        ("lpips.vgg", "no.npz", "lpips.vgg: no.npz does not exist"),
        ("lpips.vgg19", "no.npz", "lpips: .*'vgg19' was unexpected"),
        ("lpips.alex", 3, "lpips.alex: 3 is not of type"),
        ("scenes.tradeoff", {"source": "courtyard"}, "scenes.tradeoff: a rule or file"),
        ("scenes.tradeoff@csv", {"source": "courtyard"}, "tradeoff.csv: a rule or fi"),
        ("methods.tradeoff", {"model": "base", "rounds": 0}, "tradeoff: a folder"),
        ("tradeoff.scene", "yard", "tradeoff.scene: no scene 'yard'"),
        ("tradeoff.model", "huge", "tradeoff.model: no model 'huge'"),
        ("tradeoff.model", None, "tradeoff: 'model' is a required"),
        ("tradeoff.variants", {}, "tradeoff.variants: {} .*non-empty"),
        ("tradeoff.variants.fast", {}, "tradeoff.variants.fast: {} .*non-empty"),
        ("tradeoff.variants.base", {"steps": 5}, "variants.base: the model itself"),
        ("tradeoff.variants.a/b", {"steps": 5}, "tradeoff.variants: 'a/b' does not"),
        ("tradeoff.variants.a", {"stpes": 5}, "variants.a: .*'stpes' was unexpected"),
        ("tradeoff.variants.a", {"steps": 0}, "variants.a.steps: 0 is less than"),
        ("tradeoff.variants.a", {"downscale": 1}, "variants.a.downscale: 1 is less"),
        ("tradeoff.variants.a", {"samples": [8]}, r"variants.a.samples: \[8\] is too"),
        (
            "tradeoff.variants.a",
            {"field": {"levles": 2}},
            "variants.a.field: .*'levles",
        ),
        ("tradeoff.variants.a", {"field": {"kind": "gird"}}, "a.field.kind: 'gird' is"),
        ("tradeoff.variants.a", {"field": {"levels": 0}}, "a.field.levels: 0 is less"),
    ],
)
def test_a_bad_config_is_named(demo, capsys, where, value, reason):
    edit(demo, where, value)
    check_config = load_rules()["check_config"]
    with pytest.raises(SystemExit) as stopped:
        check_config(demo)
    assert stopped.value.code == 1
    error = capsys.readouterr().err
    assert re.match("error: config: .*" + reason, error)
    assert error.count("\n") == 1


def load_rules(name="config.smk", **known):
    """What a file of functions defines; the first one checks a config."""
    workflow = types.SimpleNamespace(basedir=ROOT, configfiles=[])
    path = ROOT / "workflow" / "rules" / name
    return runpy.run_path(path, init_globals={"workflow": workflow} | known)


def test_a_name_that_yaml_reads_as_a_number_is_named(demo, capsys):
    demo["scenes"][7] = {"source": "courtyard"}
    with pytest.raises(SystemExit):
        load_rules()["check_config"](demo)
    error = capsys.readouterr().err
    assert error == "error: config: scenes.7: a name must be text, quote it\n"


def test_a_key_that_stands_twice_is_named(tmp_path, demo, snakemake):
    path = write(tmp_path, demo)
    with open(path, "a") as file:
        file.write("seed: 3\n")
    code, output = snakemake(tmp_path, "--configfile", path, "-n")
    assert code == 1
    assert "key 'seed' stands twice" in output
    assert len(output.splitlines()) == 1


def test_keys_with_a_default_may_be_left_out(demo):
    wanted = copy.deepcopy(demo)
    del demo["frequency_weights"], demo["lpips"]
    load_rules()["check_config"](demo)
    assert demo == wanted
    demo["lpips"] = None
    load_rules()["check_config"](demo)
    assert demo == wanted


def test_the_weights_of_lpips_reach_the_command(tmp_path, demo, snakemake):
    (tmp_path / "my weights.npz").touch()
    demo["lpips"] = {"vgg": "my weights.npz", "squeeze": None}
    target = "results/courtyard/mipnerf360/round0/metrics.csv"
    path = write(tmp_path, demo)
    options = ("--configfile", path, "-n", "-p", target)
    code, said = snakemake(tmp_path, *options)
    assert code == 0, said
    assert " --lpips-vgg 'my weights.npz' --metrics " in said
    assert "--lpips-squeeze" not in said
    demo["lpips"] = {}
    write(tmp_path, demo)
    assert "--lpips" not in snakemake(tmp_path, *options)[1]


@pytest.mark.parametrize("folder", ["flows/{view}", "flows/{}", "flows/{scene", "{0}"])
def test_the_folder_of_flows_knows_four_names(demo, folder, capsys):
    demo["flow"] |= {"method": "files", "folder": "{scene}/{method}/{round}/{split}"}
    load_rules()["check_config"](demo)
    demo["flow"]["folder"] = folder
    with pytest.raises(SystemExit):
        load_rules()["check_config"](demo)
    assert f"config: flow.folder: {folder}: in braces only" in capsys.readouterr().err


def test_flows_made_elsewhere_reach_the_commands(tmp_path, demo, snakemake):
    template = "my flows/{scene}/{method}-{round}-{split}"
    demo["flow"] |= {"method": "files", "folder": template}
    path = tmp_path / "files.yaml"
    path.write_text(yaml.safe_dump(demo))
    targets = ["courtyard", "flow_benchmark", "--configfile", path]
    code, said = snakemake(tmp_path, "-n", "-p", *targets)
    assert code == 0
    for end in ("mipnerf360-1-train", "mipnerf360_large-2-test"):
        assert f"--method files --flows 'my flows/courtyard/{end}'" in " ".join(
            said.split()
        ).replace("--kernel lanczos --tolerance-px 1.0 ", "")
    assert "python -m flow.benchmark --scene results/courtyard --renders" in said
    assert "mipnerf360_large/round0 mipnerf360_large/round2" in said


def test_no_scene_can_have_the_name_of_a_rule():
    text = "".join(path.read_text() for path in ROOT.glob("workflow/rules/*.smk"))
    rules = set(
        re.findall(r"^(?:use rule \w+ as|rule|checkpoint) (\w+)", text, re.MULTILINE)
    )
    assert load_rules()["RULES"] == rules | {"all"}


@pytest.mark.parametrize(
    ("where", "value", "reason"),
    [
        ("training.stpes", 5, "'stpes'"),
        ("frequency_weights", "no.npz", "no.npz does not exist"),
        ("scenes.mine", {"source": "photos", "path": "no where"}, "no where does not"),
        ("scenes", None, "'scenes' is a required property"),
    ],
)
def test_planning_stops_with_one_line(tmp_path, demo, snakemake, where, value, reason):
    edit(demo, where, value)
    code, output = snakemake(tmp_path, "--configfile", write(tmp_path, demo), "-n")
    assert code == 1
    assert output.startswith("error: config: ")
    assert reason in output
    assert len(output.splitlines()) == 1
    assert not (tmp_path / "results").exists()


def no_photos(folder):
    """An empty folder of photos."""


def broken_photo(folder):
    three_apart(folder)
    (folder / "b.jpg").write_bytes((folder / "b.jpg").read_bytes()[:2000])


def three_apart(folder):
    """Three photos of different things."""
    for name, image in {
        "a": skimage.data.astronaut(),
        "b": skimage.data.coffee(),
        "c": skimage.data.chelsea(),
    }.items():
        Image.fromarray(image[:240, :320]).save(folder / f"{name}.jpg", quality=90)


def two_sizes(folder):
    for name, size in {"a": 40, "b": 40, "odd one": 50}.items():
        Image.fromarray(np.zeros((size, 64, 3), np.uint8)).save(folder / f"{name}.png")


@pytest.mark.parametrize(
    ("fill", "reason"),
    [
        (no_photos, "no images in my photos"),
        (broken_photo, "cannot decode my photos/b.jpg"),
        (three_apart, "my photos"),
        (two_sizes, "my photos: .*odd one.png"),
    ],
)
def test_bad_photos_end_in_one_line(tmp_path, demo, snakemake, fill, reason):
    (tmp_path / "my photos").mkdir()
    fill(tmp_path / "my photos")
    demo["scenes"] = {"mine": {"source": "photos", "path": "my photos"}}
    del demo["tradeoff"]
    options = ("--configfile", write(tmp_path, demo), "--cores", "2")
    code, output = snakemake(tmp_path, *options)
    assert code == 1
    assert "Traceback" not in output
    (line,) = [line for line in output.splitlines() if line.startswith("error: ")]
    assert re.search(reason, line)
    made = [path for path in (tmp_path / "results").rglob("*") if path.is_file()]
    assert [path.relative_to(tmp_path / "results") for path in made] == [
        Path("mine/logs/poses.log")
    ]
