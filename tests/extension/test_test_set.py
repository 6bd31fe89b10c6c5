"""One new file in the registry adds a test set: its image, scores, tables, rules."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from alignerf.io import images
from flow.estimation import estimate
from flow.warping import files

WHAT = """
import sys
from alignerf import testsets
from alignerf.experiment import layout
from alignerf.experiment.steps import trainings
from alignerf.tables import controls, misalignment, ranking
print(*testsets.shown_in("misalignment"))
print(*testsets.image_folders())
print(*(name for name, *_ in controls.shown()))
print("mirrored" in testsets.markdown(), "mirrored" in ranking.TEST_SETS)
print(testsets.fairest({"mirrored"}), testsets.fairest({"mirrored", "standard"}))
print(*trainings.control_folders(layout.Scene("yard")))
"""


@pytest.fixture(scope="module")
def tree(root, tmp_path_factory):
    """A copy of the tree with the patch."""
    copy = tmp_path_factory.mktemp("tree")
    for name in ("alignerf", "flow", "workflow"):
        shutil.copytree(
            root / name, copy / name, ignore=shutil.ignore_patterns("__py*")
        )
    patch = root / "tests" / "extension" / "test_set.patch"
    subprocess.run(["git", "apply", str(patch)], cwd=copy, check=True)
    return copy


def run(tree, *words):
    """What Python prints there."""
    environment = os.environ | {"PYTHONPATH": str(tree)}
    done = subprocess.run(
        [sys.executable, *words],
        cwd=tree,
        env=environment,
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_tables_rules_and_docs_know_it(tree):
    shown, folders, quantities, told, fair, needed = run(tree, "-c", WHAT).splitlines()
    assert shown.startswith("standard warped control mirrored oracle")
    assert "mirrored" in folders.split()
    order = quantities.split()
    assert order[order.index("mirroring") - 1] == "resampling"
    assert (told, fair) == ("True True", "mirrored standard")
    assert "results/yard/testset/mirrored" in needed.split()


def test_its_image_is_written(tree, tmp_path, rng):
    photo = rng.integers(0, 256, (48, 64, 3), np.uint8)
    for name in ("photos", "renders"):
        images.write(tmp_path / name / "a.png", photo)
    flow_px, valid, _ = estimate.flow_and_validity(photo, photo)
    files.write_flow(tmp_path / "flow" / "a.npz", flow_px, valid)
    names = ("photos", "renders", "flow", "out")
    places = [f"--{name}={tmp_path / name}" for name in names]
    run(tree, "-m", "flow.control_sets", *places)
    drawn = images.read(tmp_path / "out" / "mirrored" / "a.png")
    np.testing.assert_array_equal(drawn, photo[:, ::-1])
