"""What a film shows before and after: of one model, by what each config has."""

import pytest

from alignerf.experiment.tables import json_rows, sides

SCENE = "courtyard"
PLAIN, ALIGNED = {"model": "base"}, {"model": "base", "align": {}}
EXTERNAL = {"train": "theirs {data}", "render": "theirs {renders}"}


def labels(experiment):
    return [side.label for side in sides.of(experiment, SCENE)]


def test_the_demo_compares_equal_models(demo, experiment_of):
    """The reference is the large model; what aligns itself is the other one."""
    experiment = experiment_of(demo)
    before, after = sides.of(experiment, SCENE)
    assert (before.label, after.label) == ("before (mipnerf360)", "after (aligned)")
    assert before.model == "results/courtyard/mipnerf360/round0/model.msgpack"
    assert after.cameras == "results/courtyard/aligned/round0/learnt/cameras.npz"
    assert after.timing == "results/courtyard/aligned/round0/render/test.json"
    # Files that rules write, not what is inside.
    assert sides.files(experiment, SCENE) == [
        f"results/courtyard/{method}/round0/{name}"
        for method in ("mipnerf360", "aligned")
        for name in ("model.msgpack", "learnt", "render")
    ]


@pytest.mark.parametrize(
    ("methods", "expected"),
    [
        ({"plain": PLAIN}, ["plain"]),
        ({"plain": PLAIN, "a": ALIGNED}, ["before (plain)", "after (a)"]),
        ({"a": ALIGNED, "plain": PLAIN}, ["before (plain)", "after (a)"]),
        # Alignment on the way comes before rounds, and both before nothing.
        (
            {"warped": PLAIN | {"rounds": 2}, "a": ALIGNED},
            ["before (warped)", "after (a)"],
        ),
        (
            {"plain": PLAIN, "warped": PLAIN | {"rounds": 2}},
            ["before (warped)", "after (warped, round 2)"],
        ),
        # Of two that align themselves, the one of the reference's model.
        (
            {"plain": PLAIN, "big": {"model": "large", "align": {}}, "a": ALIGNED},
            ["before (plain)", "after (a)"],
        ),
    ],
)
def test_what_puts_something_right_comes_after(demo, experiment_of, methods, expected):
    demo["methods"] = methods
    if "big" in methods:
        demo["methods"] = {**methods, "plain_large": {"model": "large"}}
    experiment = experiment_of(demo)
    assert labels(experiment) == expected
    models = {side.model for side in sides.of(experiment, SCENE)}
    assert len(models) == len(expected)


@pytest.mark.parametrize(("goes_on", "count"), [(False, 1), (True, 2)])
def test_rounds_that_stop_at_once_leave_one_side(demo, experiment_of, goes_on, count):
    demo["methods"] = {"auto": PLAIN | {"rounds": "auto", "most_rounds": 1}}
    experiment = experiment_of(demo, lambda **place: goes_on)
    assert len(labels(experiment)) == count
    # What is to be made is known before it is decided.
    undecided = experiment_of(demo)
    assert sides.films(undecided) == [
        "results/courtyard/camera_path.json",
        "results/courtyard/flythrough.webm",
    ]


def test_of_another_programs_model_there_is_a_path_alone(demo, experiment_of):
    demo["methods"] = {"theirs": {"external": EXTERNAL}}
    experiment = experiment_of(demo)
    assert sides.of(experiment, SCENE) == []
    assert sides.films(experiment) == ["results/courtyard/camera_path.json"]


def test_sides_are_read_as_they_are_written(demo, experiment_of):
    experiment = experiment_of(demo)
    text = sides.option(experiment, SCENE)
    assert json_rows.read(sides.Side, text) == sides.of(experiment, SCENE)


def test_windows_have_no_film(demo, experiment_of):
    demo["windows"] = {}
    assert {path.split("/")[1] for path in sides.films(experiment_of(demo))} == {SCENE}
