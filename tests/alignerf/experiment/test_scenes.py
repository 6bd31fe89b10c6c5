"""Scenes and rows of the tables across scenes, and the files that they come from."""

import pytest

from alignerf.experiment import plan
from alignerf.experiment.tables import scenes


def names_of(experiment, scene, table):
    """(method, round) of a table's rows, without what only leads to them."""
    every = scenes.rows_of(experiment, scene, table)
    return [(row.method, row.round) for row in every if row.method]


def test_remedies_are_every_methods_last_round_at_every_length(demo, experiment_of):
    demo["methods"] = {
        "plain": {"model": "base"},
        "photos": {"model": "base", "rounds": 2},
        "joint": {"model": "base", "pose_optimization": {}},
    }
    demo["vary"] = {"seeds": [0, 2], "lengths": [0.5, 1]}
    experiment = experiment_of(demo)
    first, *others = scenes.remedies(experiment)
    assert [(one.scene, one.seed, one.share) for one in (first, *others)] == [
        ("courtyard", 0, 1),
        ("courtyard_x0.5", 0, 0.5),
        ("courtyard_seed2", 2, 1),
        ("courtyard_seed2_x0.5", 2, 0.5),
    ]
    assert {one.alike for one in others} == {first.alike}
    names = names_of(experiment, "courtyard", "remedies/")
    assert names == [("plain", 0), ("photos", 2), ("joint", 0)]
    between, plain, photos, _ = scenes.rows_of(experiment, "courtyard", "remedies/")
    # The flow of training views, where another round needed them.
    displacement = "results/courtyard/plain/round0/displacement/{}.csv"
    assert plain.files["displacement"] == displacement.format("train")
    assert "aligned_pose" in plain.files
    # All that leads there is counted: three trainings, and renders and flow of two.
    assert len(photos.way) == 3
    assert photos.flows == ["plain/round0", "photos/round1"]
    assert (between.folder, between.method) == ("photos/round1", None)
    # The same angle of error at half the size.
    half = {"downscale": 4, "perturb_px": 0.75}
    demo["scenes"]["small"] = demo["scenes"]["courtyard"] | half
    small = scenes.remedies(experiment_of(demo))[-1]
    assert small.alike != first.alike
    assert small.capture == first.capture
    del demo["scenes"]["small"]
    photos = demo["methods"].pop("photos")
    plain, *_ = scenes.rows_of(experiment_of(demo), "courtyard", "remedies/")
    assert plain.files["displacement"] == displacement.format("test")
    demo["methods"]["photos"] = photos
    demo["vary"] = {"lengths": [0.5]}
    with pytest.raises(ValueError, match=r"scenes.courtyard_x0.5: it is never trained"):
        scenes.remedies(experiment_of(demo))
    demo["vary"] = None
    demo["methods"]["photos"] = {"model": "large"}
    with pytest.raises(ValueError, match="remedies needs one model for all"):
        scenes.remedies(experiment_of(demo))


@pytest.mark.parametrize("table", ["remedies", "comparison", "tradeoff", "table2"])
def test_a_table_across_scenes_waits_for_their_rows(demo, experiment_of, table):
    demo["methods"]["mipnerf360_large"]["model"] = "base"
    demo["methods"]["mipnerf360"]["published"] = "mip-NeRF 360"
    found = scenes.across(
        plan.Experiments({"": experiment_of(demo | {"published_table": 2})})
    )
    (made,) = (one for one in found if one.name == table)
    of = "remedies" if table == "remedies" else "comparison"
    folder = f"results/courtyard/{of}"
    files = [f"{folder}/scores.csv", f"{folder}/trainings.csv"]
    more = {"remedies": "facts.json", "comparison": "cameras.npz"}
    beside = more.get(table.replace("table2", "comparison"))
    assert made.inputs == [*files, *[f"results/courtyard/{beside}"] * bool(beside)]
    assert made.options[0] == "--scenes"
    assert made.configs == ["results/courtyard/config.yaml"]
    assert f"results/{table}.csv" in made.files()
    effects = table in ("comparison", "table2")
    assert (f"results/{table}_effects.csv" in made.files()) == effects


def test_crops_stand_in_a_table_of_the_papers_for_what_they_are_of(demo, experiment_of):
    whole = demo["scenes"]["courtyard"]
    demo["scenes"]["crop"] = whole | {"crop": {"of": "courtyard", "count": 1}}
    demo["scenes"]["other"] = whole | {"perturb_px": 0}
    demo["vary"] = {"lengths": [1, 4]}
    found = scenes.printed(experiment_of(demo))
    assert [one.scene for one in found] == ["crop", "crop_x4", "other", "other_x4"]


def test_what_is_compared_has_a_length_of_the_configs_kind(demo, experiment_of):
    experiment = experiment_of(demo)
    (scene,) = scenes.compared(experiment)
    assert (scene.share, scene.reference) == (1, "mipnerf360_large")
    demo["scenes"]["courtyard"]["budget_min"] = 3
    reason = "scenes.courtyard: training has steps, the scene not"
    with pytest.raises(ValueError, match=reason):
        scenes.compared(experiment_of(demo))
