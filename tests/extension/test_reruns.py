"""What runs again after a change: the jobs that run what has changed, and no others."""

import json

import pytest

# Command and sources of every job of a config: what reruns it.
JOBS = """
import json, yaml
from alignerf.experiment import check, plan, steps
from alignerf.experiment.steps import scenes, trainings
from tests import step_cases

RULES = "poses facts preflight config collect tables draw verdict page export_folder"
RULES += " train render align testset control_sets correct_poses decompose"
RULES += " align_test_poses evaluate"

def jobs(**more):
    found = yaml.safe_load(open("tests/config.yaml"))
    found["methods"] |= more.pop("methods", {})
    experiment = plan.Experiment(check.checked(found | more))
    names = {"table": "", "split": "train", "photos": "_photos", "moved": ""}
    names |= {"method": "aligned", "what": "cameras", "scene": "courtyard"}
    for folder in experiment.trainings("courtyard"):
        w = step_cases.named(training=folder, **names)
        for rule in RULES.split():
            asked = step_cases.rule_of(rule, experiment)
            key = rule + (f" {folder}" if rule in vars(trainings) else "")
            yield key, [asked.command(w), asked.sources(w)]

THEIRS = {"methods": {"its": {"goes_on": {}}}, "flow": {"estimator": "shift"}}
try:
    theirs = dict(jobs(**THEIRS))
except ValueError:
    theirs = None
print(json.dumps([dict(jobs()), theirs]))
"""
UNUSED = ("methods/auto.py", "methods/aligned_loss.py", "captures/photos.py")
UNUSED += ("captures/polycam.py", "systems/ngp.py")
SCORES = ("evaluate", "align_test_poses", "control_sets", "tables")
PACKAGE = {
    "theirs/__init__.py": "from . import shared\n",
    "theirs/shared.py": "",
    "theirs/method.py": "from .parts import named\n"
    "from tests.extension.toy_method import GoesOn\n\n\n"
    "class Theirs(GoesOn):\n    pass\n\n\nMETHOD = Theirs()\n",
    "theirs/parts/__init__.py": "",
    "theirs/parts/named.py": "",
    "theirs/shift.py": "from tests.extension.toy_estimator import ESTIMATOR\n",
    "theirs/system.py": "from tests.extension.toy_system import SYSTEM\n",
    "theirs-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: theirs\n"
    "Version: 1.0\n",
    "theirs-1.0.dist-info/entry_points.txt": "[alignerf.methods]\n"
    "goes_on = theirs.method:METHOD\n[alignerf.estimators]\n"
    "shift = theirs.shift:ESTIMATOR\n[alignerf.systems]\n"
    "one_look = theirs.system:SYSTEM\n",
}


@pytest.fixture(scope="module")
def tree(patched):
    """(jobs of the shipped methods, jobs with another package's) in a copy, and it."""
    run = patched()

    def jobs():
        return json.loads(run(JOBS))

    return run.folder, jobs, jobs()[0]


@pytest.fixture(scope="module")
def theirs(tree):
    """Jobs where the package is installed: of the methods as before, and of its own."""
    folder, jobs, _ = tree
    for name, text in PACKAGE.items():
        (folder / "site" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "site" / name).write_text(text)
    return jobs()


@pytest.fixture
def commented():
    """(path) -> adds a comment; all is put back."""
    kept = {}

    def comment(*paths):
        for path in paths:
            kept[path] = path.read_text()
            path.write_text(kept[path] + "# More.\n")

    yield comment
    for path, text in kept.items():
        path.write_text(text)


def changed(before, after):
    """Rules of the jobs that run again; `train` and others with what they train."""
    assert before.keys() == after.keys()
    return {key for key in before if before[key] != after[key]}


def test_what_is_not_used_reruns_nothing(tree, theirs, commented):
    folder, jobs, before = tree
    assert changed(before, theirs[0]) == set()
    commented(*(folder / "alignerf" / path for path in UNUSED))
    assert changed(before, jobs()[0]) == set()


def of(*folders):
    """Jobs that run the code of trainings."""
    rules = ("train", "render", "align_test_poses")
    return {f"{rule} {folder}" for rule in rules for folder in folders}


@pytest.mark.parametrize(
    ("path", "again"),
    [
        ("alignerf/methods/align.py", of("aligned/round0")),
        ("alignerf/methods/staged.py", of("alignerf/round0", "pretrain/base")),
        ("alignerf/contributions/frequency_loss.py", of("alignerf/round0")),
        ("alignerf/captures/courtyard.py", {"poses", "export_folder"}),
        ("alignerf/causes/motion.py", {"verdict", "page"}),
        ("site/theirs/method.py", {"train its/round0"}),
        ("site/theirs/parts/named.py", {"train its/round0"}),
    ],
)
def test_what_is_used_reruns_what_runs_it(tree, theirs, commented, path, again):
    folder, jobs, _ = tree
    commented(folder / path)
    assert changed(theirs[1], jobs()[1]) == again


def test_what_a_package_imports_of_itself_reruns_as_the_package_does(
    tree, theirs, commented
):
    folder, jobs, _ = tree
    again = []
    for path in ("theirs/shared.py", "theirs/__init__.py"):
        commented(folder / "site" / path)
        again.append(changed(theirs[1], jobs()[1]))
    assert again[0] == again[1] != set()


def test_a_new_record_is_run_by_what_asks_each(patched, tree):
    """A cause by the verdict, a test set by the scores; the others by nothing yet."""
    *_, before = tree
    run = patched("toy_method.py", "capture.patch", "toy_system.py")
    assert changed(before, json.loads(run(JOBS))[0]) == set()
    for name, again in (
        ("cause", {"verdict", "page"}),
        ("test_set", {*SCORES, "verdict", "page"}),
    ):
        found = changed(before, json.loads(patched(f"{name}.patch")(JOBS))[0])
        assert {key.partition(" ")[0] for key in found} == again
