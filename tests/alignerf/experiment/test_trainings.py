"""Trainings are values: what is equal is trained once, and each knows what leads to it.

What methods come to is in test_plan.py and test_slices.py.
"""

import pytest

from alignerf.experiment import jobs, layout, plan, sources, targets, trainings

HERE = "results/courtyard"
# Of each kind that trains.
METHODS = {
    "plain": {"model": "base", "rounds": 2},
    "moved": {"model": "base", "rounds": 1, "changes": "cameras"},
    "learnt": {"model": "base", "pose_optimization": {}},
    "aligned": {"model": "base", "align": {}},
    "staged": {"model": "base", "alignerf": {}},
}


@pytest.fixture
def experiment(demo, experiment_of):
    return experiment_of(demo | {"methods": METHODS, "reference": {"method": "plain"}})


def folders(found):
    return [training.folder for training in found]


def test_every_method_makes_trainings_whose_jobs_are_right(experiment):
    for name, method in experiment.methods.items():
        rounds = experiment.rounds_of("courtyard", name)
        assert len(rounds) == method.rounds + 1
        for training in rounds:
            assert jobs.parse(training.job.model_dump()) is not training.job
    stages = {m: experiment.at("courtyard", m, 0).job.stage for m in METHODS}
    assert [m for m, stage in stages.items() if stage != "full"] == ["staged"]


def test_equal_trainings_are_one_object(demo, experiment_of):
    """Whatever the kind of their methods, under the name of the first."""
    same = {f"{name}_again": method for name, method in METHODS.items()}
    demo |= {"methods": METHODS | same, "reference": {"method": "plain"}}
    experiment = experiment_of(demo)
    for name in METHODS:
        first, again = (
            experiment.rounds_of("courtyard", m) for m in (name, f"{name}_again")
        )
        for one, other in zip(first, again, strict=True):
            assert one is other
            assert other.folder.partition("/")[0] in (name, "plain")
    # Nothing that is trained has the second's name, and so no row has.
    assert not [f for f in experiment.trainings("courtyard") if "_again" in f]
    assert not [m for m, _ in experiment.all_rounds("courtyard") if "_again" in m]
    # Its exports are of the first's training.
    paths = targets.exports(experiment)
    assert f"{HERE}/aligned_again/export/cameras" in paths


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("plain", {"model": "large"}),
        ("learnt", {"pose_optimization": {"learning_rates": [0.01, 0.001]}}),
        ("aligned", {"align": {"shrink": 2}}),
        ("staged", {"alignerf": {"radius_px": 3}}),
    ],
)
def test_unequal_jobs_are_not_shared(demo, experiment_of, name, change):
    methods = METHODS | {"other": METHODS[name] | change}
    demo |= {"methods": methods, "reference": {"method": "plain"}}
    experiment = experiment_of(demo)
    ours, theirs = (experiment.rounds_of("courtyard", m)[-1] for m in (name, "other"))
    assert ours.job != theirs.job
    assert ours.value != theirs.value
    assert theirs.folder == f"other/round{METHODS[name].get('rounds', 0)}"


def test_equal_jobs_of_other_photos_are_not_shared(experiment):
    """The first rounds have one job; one learns from warped photos."""
    warped, moved = (experiment.at("courtyard", m, 1) for m in ("plain", "moved"))
    assert warped.job == moved.job
    assert warped.value != moved.value


def test_none_of_a_scenes_trainings_stands_before_what_it_needs(experiment):
    known = []
    for folder, training in experiment.trainings("courtyard").items():
        assert training.folder == folder
        assert experiment.training("courtyard", folder) is training
        known.append(training)
        assert {*trainings.lead_to(training)} <= {*known}
    assert {"pretrain/base", "plain/round2"} <= {*folders(known)}


def test_what_a_training_took_is_told_by_the_way_to_it(experiment):
    """Its trainings, those whose renders and flow count, those then corrected."""

    def told(method, round):
        training = experiment.at("courtyard", method, round)
        ways = (trainings.lead_to, trainings.rendered_for, trainings.moved_for)
        return [folders(of(training)) for of in ways]

    first, second, third = (f"plain/round{number}" for number in range(3))
    assert told("plain", 0) == told("moved", 0) == [[first], [], []]
    assert told("plain", 2) == [[first, second, third], [first, second], []]
    assert told("moved", 1) == [[first, "moved/round1"], [first], [first]]
    assert told("staged", 0) == [["pretrain/base", "staged/round0"], [], []]
    assert told("aligned", 0) == [["aligned/round0"], [], []]


def test_training_views_are_rendered_where_they_are_looked_at(demo, experiment_of):
    experiment = experiment_of(
        demo | {"methods": METHODS, "reference": {"method": "plain"}}
    )

    def splits(folder):
        return experiment.splits("courtyard", folder)

    both = ["train", "test"]
    assert splits("plain/round0") == splits("plain/round1") == both
    for folder in ("plain/round2", "moved/round1", "aligned/round0", "staged/round0"):
        assert splits(folder) == ["test"], folder
    assert splits("pretrain/base") == []


def test_photos_that_a_training_has_warped_are_known(demo, experiment_of):
    alone = METHODS["aligned"] | {"align": {"photos_at": []}}
    methods = METHODS | {"cameras_alone": alone}
    demo |= {"methods": methods, "reference": {"method": "plain"}}
    experiment = experiment_of(demo)

    def warped(method, round):
        return experiment.at("courtyard", method, round).warped

    assert warped("plain", 0) == warped("moved", 1) == warped("staged", 0) == {}
    before = f"{HERE}/plain/round0"
    wanted = {"photos": f"{before}/warped/train", "valid": f"{before}/flow/train"}
    assert warped("plain", 1) == wanted
    # On the way it warps its own.
    learnt = f"{HERE}/aligned/round0/learnt"
    wanted = {"photos": f"{learnt}/photos", "valid": f"{learnt}/valid"}
    assert warped("aligned", 0) == wanted
    assert warped("cameras_alone", 0) == {}


def test_cameras_that_move_are_compared_with_a_truth_that_is_known(
    demo, tmp_path, experiment_of
):
    demo["scenes"]["own"] = {"source": "photos", "path": str(tmp_path)}
    experiment = experiment_of(
        demo | {"methods": METHODS, "reference": {"method": "plain"}}
    )
    truths = {
        (scene, method): experiment.at(scene, method, 0).truth
        for scene in experiment.scenes
        for method in METHODS
    }
    wanted = {("courtyard", method) for method in ("learnt", "aligned")}
    assert {key for key, truth in truths.items() if truth} == wanted
    assert {truths[key] for key in wanted} == {f"{HERE}/images/truth"}


def test_only_what_looks_at_itself_depends_on_the_flows_code(experiment):
    for folder, training in experiment.trainings("courtyard").items():
        run = map(sources.reached, ("alignerf.train", *training.records))
        aligns = any(path.name == "aligner.py" for paths in run for path in paths)
        assert aligns == (folder in ("aligned/round0", "learnt/round0")), folder


@pytest.mark.parametrize(
    ("path", "output"),
    [
        ("a/plain/round0/renders/test", "a/plain/round0/renders"),
        ("a/plain/round0/depth/train", "a/plain/round0/depth"),
        ("a/pretrain/base/render/train.json", "a/pretrain/base/render"),
        ("a/plain/round0/displacement/test.csv", "a/plain/round0/displacement"),
        ("a/plain/round0/flow/train", "a/plain/round0/flow"),
        ("a/plain/round0/warped/train", "a/plain/round0/warped"),
        ("a/plain/round0/learnt/cameras.npz", "a/plain/round0/learnt"),
        ("a/plain/round0/learnt/photos", "a/plain/round0/learnt"),
        ("a/pretrain/learnt/learnt/model.msgpack", "a/pretrain/learnt/learnt"),
        ("a/plain/round0/flow/oracle", "a/plain/round0/flow"),
        ("a/images/truth", "a/images"),
        *(
            (path, path)
            for path in (
                *("a/cameras.npz", "a/images", "a/testset/flow", "a/testset/warped"),
                *("a/plain/round0/learnt", "a/plain/round0/renders"),
                "a/plain/round0/timing.json",
                *("a/plain/round0/parts/test", "a/plain/round0/parts_photos/train"),
                "a/plain/round0/decomposition_test.csv",
                "a/plain/round0/corrected/cameras.npz",
                # A model that is called so.
                "a/pretrain/learnt/timing.json",
            )
        ),
    ],
)
def test_a_path_lies_in_the_output_of_a_rule(path, output):
    assert layout.output_of(f"results/{path}") == f"results/{output}"
    # What is no result of this experiment is left as it is.
    assert layout.output_of(f"other/{path}") == f"other/{path}"


def test_an_output_is_waited_for_once():
    paths = ["results/a/m/round0/flow/train", "results/a/m/round0/flow/test"]
    assert layout.outputs_of(paths) == ["results/a/m/round0/flow"]
    named = dict(zip(("one", "two"), paths, strict=True))
    assert layout.outputs_of(named) == dict.fromkeys(named, "results/a/m/round0/flow")


def test_a_method_that_trains_nothing_of_its_own_is_refused(demo, experiment_of):
    """It would have no row in any table, and nothing would say why."""
    demo["methods"] = {
        "first": {"model": "base", "align": {}},
        "plain": {"model": "base"},
        "second": {"model": "base", "align": {}},
    }
    with pytest.raises(
        ValueError, match=r"methods\.second: the same as methods\.first"
    ):
        plan.check_equal(experiment_of(demo))
    demo["methods"]["second"]["align"] = {"shrink": 2}
    plan.check_equal(experiment_of(demo))


def test_a_model_with_steps_of_its_own_has_them_at_every_length(demo, experiment_of):
    demo["models"]["large"]["training"] = {"steps": 500}
    demo["vary"] = {"lengths": [1, 4]}
    experiment = experiment_of(demo)
    steps = {
        (method, scene): experiment.at(scene, method, 0).job.training.steps
        for method in ("mipnerf360_large", "mipnerf360")
        for scene in experiment.scenes
    }
    assert list(steps.values()) == [500, 500, 2000, 8000]
