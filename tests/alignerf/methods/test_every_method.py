"""What holds for each method, registered here or by another package.

A record that forgets one of these is found here, and by nobody else.
"""

import json

import pytest
import yaml

from alignerf import config as config_command
from alignerf import methods, testsets
from alignerf.costs import estimate as costs
from alignerf.experiment import check, jobs, plan, sources, targets
from alignerf.experiment.steps import scenes
from alignerf.experiment.tables import rows
from alignerf.experiment.tables import scenes as table_scenes
from alignerf.methods import align, base, pose_optimization

VIEWS, RATES = costs.Views(16, 4, 30000), costs.Rates(6.0, 0.01, 10**8)
HERE = "results/courtyard"


def named(record):
    return record.key or "plain"


def experiment_with(demo, record, **changes):
    """A plain method, and one of the record, `its`."""
    its = yaml.safe_load(record.example) | changes
    config = demo | {"methods": {"plain": {"rounds": 1}, "its": its}, "crops": None}
    config |= {"preflight": True, "reference": {"method": "plain"}}
    config = check.checked(config)
    return plan.Experiment(config)


def last(experiment):
    """The training of the method's last round."""
    return experiment.rounds_of("courtyard", "its")[-1]


def check_label(experiment):
    label, moves = methods.label(experiment, "its"), experiment.moves("its")
    assert label.strip() == label != ""
    assert "\n" not in label
    # Who reads a table has to know whose cameras a score is by.
    if "cameras" in moves:
        assert "cameras" in label or "poses" in label
    assert label != methods.label(experiment, "plain") or not experiment.moves("its", 0)


def check_moves(experiment):
    """Its training does what the record says; tables, export and page know it."""
    moves = experiment.moves("its")
    training = last(experiment)
    assert targets.moves_cameras(training) == ("cameras" in moves)
    assert bool(training.warped) == ("photos" in moves)
    exports = [path for path in targets.exports(experiment) if "/its/" in path]
    wanted = [f"{HERE}/its/export/{what}" for what in ("cameras", "photos")]
    assert (wanted[0] in exports) == bool(moves)
    assert (wanted[1] in exports) == ("photos" in moves)
    if "cameras" in experiment.moves("its", 0):
        cameras = f"{training.path.learnt}/cameras.npz"
        assert scenes.moved_cameras(experiment, "courtyard") == ("its", cameras)


def check_test_set(experiment):
    """Cameras that moved are scored by aligned poses, where these can be rendered."""
    table = {(r.method, r.round): r for r in rows.of_scene(experiment, "courtyard")}
    for round in range(experiment.methods["its"].rounds + 1):
        moves = experiment.moves("its", round)
        if row := table.get(("its", round)):
            assert (row.moves_cameras, row.moves_photos) == tuple(
                what in moves for what in ("cameras", "photos")
            )
            known = {"standard", *["aligned_pose"] * ("aligned_pose" in row.files)}
            # Another program's model cannot be asked for a view by another camera.
            ours = "its" in experiment.names("ours")
            fair = "aligned_pose" if ours and "cameras" in moves else "standard"
            assert testsets.fairest(known, moves) == fair


def check_tables(experiment):
    """It has a row in each table, and is drawn beside its baseline."""
    for table in "", "comparison/":
        found = table_scenes.rows_of(experiment, "courtyard", table)
        assert "its" in [row.method for row in found]
    if "its" in experiment.names("ours"):
        drawn = scenes.compared(experiment, "courtyard")
        assert "its" in [shown.method for shown in drawn]


def check_cost(experiment):
    """It takes time."""
    work = json.loads(costs.as_json(experiment, "courtyard"))
    training = last(experiment)
    (one,) = (x for x in work["trainings"] if x["name"] == training.folder)
    if training.job.ours:
        job = jobs.parse(training.job.model_dump())
        assert type(job) is type(training.job)
        least_s = RATES.start_s + job.steps * RATES.step_s
        assert costs.seconds_of(one, RATES, VIEWS) >= least_s


def check_part(experiment):
    """Its part of a training is there, and its code is what the training depends on."""
    training = last(experiment)
    if training.job.ours:
        assert all(map(sources.file_of, experiment.records_of(training)))
        part = base.part_of(training.job)
        assert isinstance(part, base.Part)
        assert bool(training.job.part) == (type(part) is not base.Part)
        assert training.job.part or not training.job.moves


def check_keys(record):
    """Its keys are in the schema, with a meaning each."""
    schema = yaml.safe_load(config_command.schema_text())["$defs"]
    shown = schema["Method"]["properties"][record.key]
    assert shown["description"].strip()
    if record.Keys:
        keys = schema[record.Keys.__name__]["properties"]
        assert all(key["description"].strip() for key in keys.values())


@pytest.mark.parametrize("record", methods.every(), ids=named)
def test_a_method_is_known_everywhere(demo, record):
    if record.key:
        check_keys(record)
    experiment = experiment_with(demo, record)
    assert methods.of_method(experiment.methods["its"]) is record
    check_label(experiment)
    check_test_set(experiment)
    if not record.from_scratch:
        check_tables(experiment)
    check_moves(experiment)
    check_cost(experiment)
    check_part(experiment)


@pytest.mark.parametrize("record", methods.every(), ids=named)
def test_a_method_that_changes_cameras_in_rounds_is_too(demo, record):
    if "changes" not in record.beside:
        return
    experiment = experiment_with(demo, record, changes="cameras", rounds=2)
    check_label(experiment)
    check_test_set(experiment)
    if not record.from_scratch:
        check_tables(experiment)
    check_moves(experiment)


@pytest.mark.parametrize(
    ("record", "forgets", "found_by"),
    [
        (pose_optimization.METHOD, "moves", check_moves),
        (pose_optimization.METHOD, "words", check_label),
        (pose_optimization.METHOD, "jobs", check_moves),
        (align.METHOD, "moves", check_moves),
        (align.METHOD, "jobs", check_moves),
    ],
)
def test_one_that_forgets_is_found(demo, monkeypatch, record, forgets, found_by):
    experiment = experiment_with(demo, record)
    found_by(experiment)
    monkeypatch.setattr(type(record), forgets, getattr(base.Method, forgets))
    with pytest.raises((AssertionError, ValueError)):
        found_by(experiment_with(demo, record))
