"""Scenes and rows of the tables across scenes, and the files that they come from."""

import pytest

from alignerf.experiment import plan
from alignerf.experiment.tables import scenes


@pytest.mark.parametrize("table", ["comparison", "tradeoff", "table2"])
def test_a_table_across_scenes_waits_for_their_rows(demo, experiment_of, table):
    demo["methods"]["mipnerf360_large"]["model"] = "base"
    demo["methods"]["mipnerf360"]["published"] = "mip-NeRF 360"
    found = scenes.across(
        plan.Experiments({"": experiment_of(demo | {"published_table": 2})})
    )
    (made,) = (one for one in found if one.name == table)
    folder = "results/courtyard/comparison"
    files = [f"{folder}/scores.csv", f"{folder}/trainings.csv"]
    beside = ["results/courtyard/cameras.npz"] * (table != "tradeoff")
    assert made.inputs == [*files, *beside]
    kind = "tradeoff" if table == "tradeoff" else "comparison"
    assert made.command[:4] == ["alignerf.tabulate", "--table", kind, "--scenes"]
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
