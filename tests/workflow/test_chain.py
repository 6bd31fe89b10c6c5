"""The whole chain on a tiny courtyard: photos to tables, then what reruns when."""

import random
import re
import shutil

import numpy as np
import pytest
import yaml

from tests.workflow import chain_checks as chain
from tools.torture import damage, stages

# Share of patches x patch_px^2 = 2 x batch_rays: the shares .6 and .2 of the steps
# then see as many rays as the baseline.
CONFIG = f"""
preflight: false
scenes:
  tiny:
    source: courtyard
    poses: truth
    test_every: {chain.EVERY}
    perturb_px: 0.5
    courtyard:
      views: {chain.VIEWS}
      width: {chain.WIDTH}
      height: {chain.HEIGHT}
      supersample: 1
      lens_sigma_px: 0
models:
  base: &base
    samples: [16, 8]
    proposal: &field
      {{ kind: grid, levels: 4, log2_hashmap_size: 10, max_resolution: 64, width: 8 }}
    field: {{ <<: *field, view_widths: [8] }}
  large:
    <<: *base
    field: {{ <<: *field, view_widths: [8], log2_hashmap_size: 12 }}
methods:
  mipnerf360_large: {{ model: large, rounds: 1 }}
  mipnerf360: {{ model: base, rounds: 1 }}
  aligned: {{ model: base, align: {{ estimator: dis_fine, min_move_px: 0 }} }}
  alignerf:
    model: base
    alignerf: {{ patches: 2, patch_px: 16, radius_px: 2, features: 4 }}
training:
  steps: 200
  batch_rays: 256
  learning_rates: [0.03, 0.003]
  warmup_steps: 10
flow: {{ estimator: dis_fine, tolerance_px: 4.0 }}
"""


# Stages that start in a second, and how many of their inputs are damaged.
CHEAP = ("flow.align", "flow.decompose", "flow.control_sets", "flow.figures.scene")
CHEAP += ("alignerf.evaluate", "alignerf.tables.collect", "alignerf.tabulate")
CHEAP += ("alignerf.verdict",)
DAMAGED = 12

BY_CAMERA = {"decompose"}


def check_reruns(plan, root, config):
    """What a change of a source or of a setting makes again, and nothing else."""
    assert "Nothing to be done" in plan()
    moved, tuned = {"align_test_poses"}, {"train alignerf/round0"}
    in_loop = {"train aligned/round0"}
    # Which sources a job runs is `sources_of`'s: one plan shows that it waits for them.
    for path, old, new, rules in (
        (root / "flow/camera/fit.py", "\n", "\n\n", BY_CAMERA | moved | in_loop),
        (config, "features: 4", "features: 5", {"config", *tuned}),
        (config, "tolerance_px: 4.0", "tolerance_px: 2.0", {"align", "config"}),
        # Tables run too, since the complete config that they cite is made again.
        (
            config,
            "base, rounds: 1",
            "base, rounds: 0",
            # No round follows, so that the test views alone are rendered.
            {"config", "render"},
        ),
    ):
        before = path.read_text()
        assert old in before
        path.write_text(before.replace(old, new, 1))
        output = plan()
        assert changed(output) == rules, (path.name, new)
        if "rounds" in old:
            assert {"draw", "tables"} <= planned(output)
        path.write_text(before)
    assert "Nothing to be done" in plan()


def check_damage(folder, plan, python):
    """Some of what `make torture` does to the files of a chain, stage by stage."""
    chosen, rng = random.Random(0), np.random.default_rng(0)
    known = [
        stage._replace(command=[str(python), *stage.command[1:]])
        for stage in stages.of_plan(plan("--forceall", "-p"))
    ]
    cases = [
        (stage, path, way)
        for stage in known
        if stage.module in CHEAP
        for path in stages.inputs_of(stage, folder)
        for way in damage.ways_of(folder / path)
    ]
    assert {stage.module for stage, _, _ in cases} == set(CHEAP)
    tried, found = 0, []
    while tried < DAMAGED:
        case = chosen.choice(cases)
        fault, ended = stages.attack(*case, folder, folder / "damaged", rng)
        tried += ended is not None
        if fault:
            found.append(f"{case[0].module}, {case[1]}, {case[2]}: {fault}")
    shutil.rmtree(folder / "damaged")
    assert found == []


def planned(output):
    """Rules that a plan would run, for whatever reason."""
    stats = output.split("Job stats:")[1].split("\n\n")[0]
    return set(re.findall(r"^(\w+) +\d+$", stats, re.MULTILINE))


def changed(output):
    """Rules that would run for their parameters: their sources or their settings.

    Those that run anyway, since an input is made again, are not among them. `train` is
    with what it trains: one rule has trainings that depend on other code and settings.
    """
    found = set()
    for job in re.split(r"\n(?=\[)", output):
        rule = re.search(r"^(?:local)?rule (\w+):", job, re.MULTILINE)
        if not (rule and re.search("^    reason: .*Params have changed", job, re.M)):
            continue
        name = rule[1]
        if name == "train":
            name += " " + re.search(r"    wildcards: .*training=([\w/]+)", job)[1]
        found.add(name)
    return found


@pytest.mark.whole
def test_the_whole_chain(tmp_path, root, forked, subtests, monkeypatch):
    project = tmp_path / "a project"
    for name in ("alignerf", "flow", "workflow"):
        skipped = shutil.ignore_patterns("__pycache__")
        shutil.copytree(root / name, project / name, ignore=skipped)
    for name in ("Snakefile", "environment.yml", "requirements.lock"):
        shutil.copy(root / name, project / name)
    config = tmp_path / "tiny.yaml"
    config.write_text(CONFIG)
    assert yaml.safe_load(CONFIG)["scenes"].keys() == {"tiny"}
    options = (tmp_path, "--configfile", config)

    def run(*words):
        code, output = forked.snakemake(*options, *words, root=project)
        assert code == 0, output
        return output

    def plan(*words):
        return run("-n", *words)

    output = run("--cores", "2", "tiny", "tradeoff")
    # Four rounds, one aligned in the loop, the two stages, and no other.
    assert re.search(r"^train +7$", output, re.MULTILINE)
    scene = tmp_path / "results" / "tiny"
    with subtests.test("damage"):
        monkeypatch.setenv("PYTHONPATH", str(project))
        check_damage(tmp_path, plan, forked.python)
        monkeypatch.undo()
    with subtests.test("scene"):
        chain.check_scene(scene)
    with subtests.test("rows"):
        chain.check_rows(scene)
    with subtests.test("table"):
        chain.check_table(scene)
    with subtests.test("verdict"):
        chain.check_verdict(scene, output)
    with subtests.test("metrics"):
        chain.check_metrics(scene)
    with subtests.test("parts"):
        chain.check_parts(scene)
    with subtests.test("figures"):
        chain.check_figures(scene)
    with subtests.test("warped photos"):
        chain.check_warped_photos(scene)
    with subtests.test("controls"):
        chain.check_controls(scene)
    with subtests.test("tradeoff"):
        chain.check_tradeoff(tmp_path / "results")
    with subtests.test("logs"):
        chain.check_logs(scene)
    with subtests.test("report"):
        run("--report", "report.html")
        assert "misalignment.csv" in (tmp_path / "report.html").read_text()
    with subtests.test("reruns"):
        check_reruns(plan, project, config)
    with subtests.test("latex"):
        chain.check_latex(scene, tmp_path)
