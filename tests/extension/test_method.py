"""A patch of one new file adds a method: all that holds for others holds for it."""

import json
import shutil

import pytest

from tests.extension import toy_loss

COUNTED = """
import json, pytest, yaml
from alignerf import config, methods
from alignerf.costs import estimate as costs
from alignerf.experiment import check, plan, targets
from alignerf.experiment.tables import rows

def checked(its):
    config = yaml.safe_load(open("tests/config.yaml"))
    config["methods"] = {"plain": {}, "its": {"corrected": its}}
    return check.checked(config | {"reference": {"method": "plain"}})

def fault(its):
    try:
        checked(its)
    except ValueError as error:
        return str(error)

experiment = plan.Experiment(checked({}))
work = costs.of_scene(experiment, "courtyard")
table = {row.method: row for row in rows.of_scene(experiment, "courtyard")}
print(json.dumps({
    "schema": yaml.safe_load(config.schema_text())["$defs"]["Settings"]["properties"],
    "label": table["its"].description,
    "moves": table["its"].moves_cameras,
    "way": table["its"].way,
    "faults": [fault({"share": 2}), fault({"first": 0.9}), fault({"shar": 0.3})],
    "exports": [path for path in targets.exports(experiment) if "/its/" in path],
    "work": [one for one in work["trainings"] if one["name"] == "its/round0"],
}))
"""
EVERY = """
import yaml
from alignerf import methods
from tests.alignerf.methods import test_every_method as every

(record,) = (one for one in methods.every() if one.key == "corrected")
demo = yaml.safe_load(open("tests/config.yaml"))
experiment = every.experiment_with(demo, record)
every.check_keys(record)
for name in ("label", "moves", "test_set", "tables", "cost", "part"):
    getattr(every, f"check_{name}")(experiment)
"""


LOSS = """
import pathlib
from alignerf import config
from alignerf.methods import base, trimmed

pathlib.Path("mine.yaml").write_text(
    "scenes: {a: {source: courtyard}}\\n"
    "methods: {plain: {}, mine: {trimmed: {share: 0.9}}}\\n"
)
for loss in (
    trimmed.Part.data_loss,
    lambda self, rendering, photo, weight: rendering.rgb,
    lambda self, rendering, photo, weight: (rendering.values - photo) ** 2,
):
    trimmed.Part.data_loss = loss
    base.part_of.cache_clear()
    try:
        config.main(["--check", "mine.yaml"])
        print("right")
    except ValueError as error:
        print(error)
"""


@pytest.fixture(scope="module")
def run(patched):
    return patched("method.patch")


def test_a_method_is_planned_costed_said_and_exported(run):
    told = json.loads(run(COUNTED))
    assert told["schema"].keys() == {"first", "share"}
    assert told["label"] == "grid 2^15, cameras corrected once"
    assert told["moves"]
    assert told["way"] == ["plain/round0", "its/round0"]
    assert told["exports"] == ["results/courtyard/its/export/cameras"]
    (work,) = told["work"]
    assert work["after"] == ["plain/round0"]
    assert work["job"]["training"]["steps"] == 1000
    share, first, unknown = told["faults"]
    assert share.startswith("config: methods.its.corrected.share: 2 should be less")
    assert first.startswith("config: methods.its.corrected.first: less than share")
    assert unknown.endswith("perhaps 'share'")


def test_a_loss_is_traced_before_anything_runs(patched):
    run = patched()
    shutil.copy(toy_loss.__file__, run.folder / "alignerf/methods/trimmed.py")
    *_, right, unknown, unsummed = run(LOSS).splitlines()
    assert right == "right"
    where = "mine.yaml: methods.mine: its loss: "
    assert (
        unknown == f"{where}AttributeError: 'Rendering' object has no attribute 'rgb'"
    )
    assert unsummed.startswith(f"{where}TypeError: ")


def test_what_holds_for_every_method_holds_for_it(run):
    run(EVERY)
