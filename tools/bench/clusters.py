"""What the paper's Tables 2 and 3 cost on a cluster: hours of accelerators, money.

Trainings and their lengths are those of table2.yaml and table3.yaml in full size. What
a ray takes is what the compiler counts of a step of each system. Renders of the test
views cost a third of a ray's step: no gradient, no Adam.

Nothing here was measured on an accelerator: hours follow from the arithmetic and from
TFLOPS, which you should replace by yours. A hash grid waits for memory instead, so that
its hours are too few.
"""

import json
from pathlib import Path

import yaml

from alignerf.experiment import check, jobs, plan
from tools.bench import cases, measure, ours

ROOT = Path(__file__).resolve().parents[2]
TABLES = (2, 3)
# Test views of the five scenes, index % 8 == 0, and their size by table.
TEST_VIEWS = 25 + 22 + 24 + 16 + 18
PIXELS = {2: 2560 * 1680, 3: 1280 * 840}
RENDERING = 1 / 3
# Assumptions: what a rented accelerator reaches in such networks, a
# quarter of its peak in bfloat16; and prices of an hour, in US dollars.
TFLOPS, GPU_USD = 75.0, 2.5
# Rays of a step; fine-tuning takes a patch.
RAYS = 64


def run(options):
    """Rows: the arithmetic of each system's rays in a table; the rest in its note."""
    found = [row for table in TABLES for row in trainings_of(table)]
    if options.quick:
        found = found[:1]
    programs = {key: job for _, _, key, job, _ in found}
    flop = {key: of_ray(job, options) for key, job in programs.items()}
    return [
        measure.Row(
            what=f"Table {table}: {name}",
            unit="GFLOP a ray",
            ours=measure.one(flop[key] / 1e9),
            note=note(rays, flop[key]),
        )
        for table, name, key, _, rays in found
    ]


def trainings_of(table):
    """(table, system, its program, a job of it, rays of all scenes and lengths)."""
    experiment = experiment_of(ROOT / f"workflow/config/table{table}.yaml")
    found = {}
    for scene in experiment.scenes:
        for one in experiment.trainings(scene).values():
            values = json.loads(one.job.text)
            job, name = jobs.parse(values), one.folder.removesuffix("/round0")
            rays = job.steps * job.rays_per_step
            if job.stage != "pretrain":
                rays += RENDERING * PIXELS[table] * TEST_VIEWS / 5
            key, before = program(values), found.get(name, (None, None, 0))[2]
            found[name] = (key, values, before + rays)
    return [(table, name, *rest) for name, rest in found.items()]


def experiment_of(path):
    """The experiment of a config in full size, without weights."""
    config = yaml.safe_load(path.read_text()) | {"small": False}
    config["full_size"] |= {"frequency_weights": None, "lpips": {}}
    return plan.Experiment(check.checked(config, [str(path)]))


def program(job):
    """What of a job decides a ray's cost."""
    return json.dumps([job["model"], job["stage"], job.get("alignerf")], sort_keys=True)


def of_ray(job, options):
    """Floating-point operations of a ray of a job's training."""
    parsed = small(job, RAYS, options)
    training = ours.Training(parsed, cases.orbit())
    return training.flop / parsed.rays_per_step


def small(job, rays, options):
    """A job with so few rays a step, or with one patch."""
    job = json.loads(json.dumps(job))
    job["training"]["batch_rays"] = rays
    if job["stage"] == "finetune":
        job["alignerf"]["patches"] = 1
        job["alignerf"] |= {"radius_px": job["alignerf"]["radius_px"] or 8}
    if options.quick:
        job["model"] = {**cases.TINY, "kind": "mipnerf360", "training": {}}
    return jobs.parse(job)


def note(rays, flop):
    """Rays of all trainings, and an accelerator's hours and money for them."""
    hours = rays * flop / TFLOPS / 1e12 / 3600
    return f"{rays / 1e9:.1f} G rays, {hours:.0f} h, {hours * GPU_USD:.0f} USD"
