"""What jobs of a scene read and run: its page, its verdict, its exports."""

import json
from types import SimpleNamespace

import pytest

from alignerf.experiment.steps import scenes, trainings
from tests import step_cases as cases


def of_demo(demo, methods, **more):
    """The demo with some of its methods, the first its reference."""
    reference = {"method": next(iter(methods)), "round": 0}
    return demo | {"methods": methods, "reference": reference} | more


def test_a_method_that_aligns_itself_tells_how_the_cameras_moved(demo, experiment_of):
    methods = {"plain": {}, "aligned": {"align": {}}}
    experiment = experiment_of(of_demo(demo, methods, crops={"px": 96}))
    moved = "results/courtyard/aligned/round0/learnt"
    found = cases.options("page", experiment, "courtyard")
    assert found["crops"] == "results/courtyard_crops/plain/round0"
    assert found["crops-corrected"] == ("results/courtyard_crops_aligned/plain/round0")
    assert found["crops-by"] == found["moved-by"] == "aligned"
    assert found["moved"] == f"{moved}/cameras.npz"
    # The page waits for what it reads.
    files = cases.inputs("page", experiment, "courtyard")
    assert files["moved"] == moved
    assert files["warped"] == ["results/courtyard/plain/round0/warped"]
    for scene in ("courtyard_crops", "courtyard_crops_aligned"):
        assert f"results/{scene}/images" in files["photos"]
        for kind in ("cameras.npz", "plain/round0/renders"):
            assert f"results/{scene}/{kind}" in files["crops"]


def test_where_no_camera_moves_there_are_no_arrows(demo, experiment_of):
    experiment = experiment_of(of_demo(demo, {"plain": {}}))
    found = cases.options("page", experiment, "courtyard")
    assert not {name for name in found if "moved" in name or "crops" in name}
    files = cases.inputs("page", experiment, "courtyard")
    assert not {"moved", "crops", "photos"} & files.keys()


def test_rounds_of_cameras_tell_it_too(demo, experiment_of):
    methods = {"moving": {"rounds": 1, "changes": "cameras"}}
    experiment = experiment_of(of_demo(demo, methods))
    found = cases.options("page", experiment, "courtyard")
    assert found["moved-by"] == "moving"
    assert found["moved"].startswith("results/courtyard/moving/round1/")
    only_photos = {"photos": {"align": {"cameras_at": []}}, "plain": {}}
    experiment = experiment_of(of_demo(demo, only_photos))
    assert scenes.moved_cameras(experiment, "courtyard") is None


def judging(experiment_of, folder, **changes):
    """An experiment that judges renders."""
    judged = {"renders": folder, "cameras": folder, "splits": ["train"]} | changes
    scene = {"source": "external_renders", "path": folder, "external_renders": judged}
    return experiment_of(
        {
            "scenes": {"mine": scene},
            "methods": {"theirs": {"external": {"renders": folder}}},
            "reference": {"method": "theirs", "round": 0},
        }
    )


def test_of_judged_renders_their_flow_tells_it(experiment_of, tmp_path):
    path = "results/mine/theirs/round0/corrected/cameras.npz"
    for changes, wanted in (
        ({}, ("flow", path)),
        ({"cameras": None}, None),
        ({"splits": ["test"]}, None),
    ):
        experiment = judging(experiment_of, str(tmp_path), **changes)
        assert scenes.moved_cameras(experiment, "mine") == wanted


def test_renders_that_are_judged_need_no_training(experiment_of, tmp_path):
    """Nor a preflight; they are taken from what rule `poses` has found."""
    experiment = judging(experiment_of, str(tmp_path))
    job = {"training": "theirs/round0"}
    assert "preflight" not in cases.inputs("train", experiment, "mine", **job)
    read = cases.inputs("render", experiment, "mine", **job)
    assert read == {
        "learnt": "results/mine/theirs/round0/learnt",
        "cameras": "results/mine/cameras.npz",
        "images": "results/mine/images",
    }
    assert cases.options("render", experiment, "mine", **job)["splits"] == "train"


@pytest.mark.parametrize("known", [True, False])
def test_the_truth_reaches_the_flow_to_it(demo, tmp_path, experiment_of, known):
    demo["scenes"]["own"] = {"source": "photos", "path": str(tmp_path)}
    experiment, scene = experiment_of(demo), "courtyard" if known else "own"
    job = {"training": "mipnerf360/round0"}
    found = cases.options("align", experiment, scene, **job)
    wanted = "results/courtyard/images/truth/oracle" if known else None
    assert found.get("oracle") == wanted
    at = f"results/{scene}/mipnerf360/round0"
    for photos in ("", "_photos"):
        parts = {"photos": photos, "split": "test"}
        found = cases.options("decompose", experiment, scene, **job, **parts)
        by_truth = known and not photos
        assert found.get("model-flow") == (f"{at}/flow/oracle" if by_truth else None)
        own = f"{at}/learnt" if photos else f"results/{scene}"
        assert found["cameras"] == f"{own}/cameras.npz"


def test_another_program_asks_for_what_its_method_says(demo, experiment_of):
    keys = {"train": "a {data}", "render": "b {renders}", "gpu": 2, "mem_mb": 123}
    experiment = experiment_of(of_demo(demo, {"theirs": {"external": keys}}))
    w = SimpleNamespace(scene="courtyard", training="theirs/round0")
    for function in (trainings.train, trainings.render):
        step = function(experiment, w)
        assert (step.gpu, step.memory_mb) == (2, 123)


def test_methods_of_some_lengths_are_scored_and_shown_at_these(demo, experiment_of):
    methods = {
        "plain": {"rounds": 1},
        "aligned": {"align": {}, "lengths": [1]},
        "bundled": {"adjust": True, "lengths": [1]},
        "alignerf": {"alignerf": {}, "lengths": [1]},
    }
    experiment = experiment_of(of_demo(demo, methods, vary={"lengths": [1, 4]}))
    for scene, known in (("courtyard", methods), ("courtyard_x4", ["plain"])):
        found = experiment.all_rounds(scene)
        assert {name for name, _ in found} == {*known}
        for rule in ("draw", "verdict", "page"):
            words = " ".join(map(str, cases.inputs(rule, experiment, scene).values()))
            assert {name for name in methods if f"/{name}/round" in words} <= {*known}
        crops = json.loads(cases.options("draw", experiment, scene)["crops"])
        (first, warped), others = [one["method"] for one in crops[:2]], crops[2:]
        assert (first, warped) == ("plain", "plain, round 1")
        assert {one["method"] for one in others} == {*known} - {"plain"}


def test_a_verdict_reads_what_remedies_brought(demo, experiment_of):
    methods = {"plain": {}, "aligned": {"align": {}}}
    experiment = experiment_of(of_demo(demo, methods, crops={"px": 96}))
    found = cases.options("verdict", experiment, "courtyard")
    at = "results/courtyard/aligned/round0"
    assert json.loads(found["aligned"]) == {"aligned": f"{at}/timing.json"}
    assert json.loads(found["corrected"]) == {"aligned": f"{at}/learnt/cameras.npz"}
    assert found["misalignment"] == "results/courtyard/tables/misalignment.csv"
    # Crops are compared with no remedy of theirs.
    found = cases.options("verdict", experiment, "courtyard_crops")
    assert "corrected" not in found
    assert "crops" not in found
