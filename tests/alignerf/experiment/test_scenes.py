"""Scenes and rows of the tables across scenes, and the files that they come from."""

import pytest

from alignerf.experiment.tables import rows, scenes

WARM = {"from": "mipnerf360", "learning_rates": [0.005, 0.001]}


def names_of(experiment, scene, table):
    """(method, round) of a table's rows, without what only leads to them."""
    every = scenes.rows_of(experiment, scene, table)
    return [(row.method, row.round) for row in every if row.method]


def test_regimes_have_the_baseline_first_and_warped_photos_last(demo, experiment_of):
    demo["scenes"]["again"] = demo["scenes"]["courtyard"] | {"seed": 1}
    # Neither where a method stands nor one of another model changes the rows.
    demo["methods"] = {
        "warm": {"model": "base", "rounds": 1, "warm_start": WARM},
        "other": {"model": "large", "rounds": 1},
        **{name: demo["methods"][name] for name in ("mipnerf360", "alignerf")},
    }
    experiment = experiment_of(demo)
    assert names_of(experiment, "again", "regimes/") == [
        ("mipnerf360", 0),
        ("alignerf", 0),
        ("mipnerf360", 1),
        ("mipnerf360", 2),
        ("warm", 1),
    ]
    first, second = scenes.regimes(experiment)
    assert (first.seed, second.seed) == (0, 1)
    assert first.like == second.like
    for scene in (first, second):
        assert (scene.perturb_px, scene.motion_m, scene.steps) == (1.5, 0.02, 2000)
    every = scenes.rows_of(experiment, "again", "regimes/")
    (warped,) = (row for row in every if (row.method, row.round) == ("mipnerf360", 1))
    assert warped.flows == ["mipnerf360/round0"]
    rendered = "results/again/mipnerf360/round0/render"
    assert rendered in rows.files_of(every)
    demo["methods"].pop("alignerf")
    with pytest.raises(ValueError, match="regimes need methods with alignerf"):
        scenes.regimes(experiment_of(demo))


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
    demo["methods"]["photos"]["rounds"] = "auto"
    with pytest.raises(ValueError, match=r"methods.photos.rounds: .* not auto"):
        scenes.remedies(experiment_of(demo))
    demo["methods"]["photos"] = {"model": "large"}
    with pytest.raises(ValueError, match="remedies needs one model for all"):
        scenes.remedies(experiment_of(demo))


def test_a_round_begins_with_the_flow_of_the_one_before(demo, experiment_of):
    """Its rendering and flow are told by the processes too; of others not."""
    experiment = experiment_of(demo)
    every = {row.folder: row for row in scenes.rows_of(experiment, "courtyard", "")}
    rounds = [every[f"mipnerf360/round{number}"] for number in range(3)]
    assert [row.before for row in rounds] == [None, *(r.folder for r in rounds[:2])]
    processes = {"render_process", "align_process", "render_test", "align_test"}
    assert [processes <= row.files.keys() for row in rounds] == [True, True, False]
    assert all("parts" in row.files for row in rounds)
    assert every["pretrain/base"].files.keys() == {"timing", "process"}
    # Across scenes less is needed.
    for row in scenes.rows_of(experiment, "courtyard", "comparison/"):
        assert not row.files.keys() & {"parts", *processes}


@pytest.mark.parametrize("table", ["regimes", "remedies", "comparison", "tradeoff"])
def test_a_table_across_scenes_waits_for_their_rows(demo, experiment_of, table):
    demo["methods"]["mipnerf360_large"]["model"] = "base"
    experiment = experiment_of(demo)
    (made,) = (one for one in scenes.across(experiment) if one.name == table)
    of = "comparison" if table == "tradeoff" else table
    folder = f"results/courtyard/{of}"
    files = [f"{folder}/scores.csv", f"{folder}/trainings.csv"]
    more = {"regimes": ["testset/displacement.csv"], "remedies": ["facts.json"]}
    beside = [f"results/courtyard/{path}" for path in more.get(table, [])]
    assert made.inputs(experiment) == [*files, *beside]
    assert made.options(experiment)[0] == "--scenes"
    assert made.configs(experiment) == ["results/courtyard/config.yaml"]


def test_what_is_compared_has_a_length_of_the_configs_kind(demo, experiment_of):
    experiment = experiment_of(demo)
    (scene,) = scenes.compared(experiment)
    assert (scene.share, scene.reference) == (1, "mipnerf360_large")
    demo["scenes"]["courtyard"]["budget_min"] = 3
    reason = "scenes.courtyard: training has steps, the scene not"
    with pytest.raises(ValueError, match=reason):
        scenes.compared(experiment_of(demo))
