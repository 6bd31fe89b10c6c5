"""Rows of the tables of regimes and of remedies."""

import pytest

from alignerf.experiment.tables import regimes

WARM = {"from": "mipnerf360", "learning_rates": [0.005, 0.001]}


def test_regimes_have_the_baseline_first_and_warped_photos_last(demo, experiment_of):
    demo["scenes"]["again"] = demo["scenes"]["courtyard"] | {"seed": 1}
    # Neither where a method stands nor one of another model changes the rows.
    demo["methods"] = {
        "warm": {"model": "base", "rounds": 1, "warm_start": WARM},
        "other": {"model": "large", "rounds": 1},
        **{name: demo["methods"][name] for name in ("mipnerf360", "alignerf")},
    }
    experiment = experiment_of(demo)
    names = regimes.rounds(experiment, "again", "mipnerf360")
    assert names == [
        ("mipnerf360", 0),
        ("alignerf", 0),
        ("mipnerf360", 1),
        ("mipnerf360", 2),
        ("warm", 1),
    ]
    found = regimes.scenes(experiment)
    assert [(m.method, m.round) for m in found[1].methods] == names
    assert [regime.seed for regime in found] == [0, 1]
    assert found[0].alike == found[1].alike
    known = {(r.perturb_px, r.motion_m, r.steps) for r in found}
    assert known == {(1.5, 0.02, 2000)}
    rendered = "results/again/mipnerf360/round0/render/train.json"
    assert rendered in found[1].methods[2].data
    demo["methods"].pop("alignerf")
    with pytest.raises(ValueError, match="regimes need methods with alignerf"):
        regimes.scenes(experiment_of(demo))


def test_remedies_are_every_methods_last_round_at_every_length(demo, experiment_of):
    demo["methods"] = {
        "plain": {"model": "base"},
        "photos": {"model": "base", "rounds": 2},
        "joint": {"model": "base", "refine": {}},
    }
    demo["vary"] = {"seeds": [0, 2], "lengths": [0.5, 1]}
    found = regimes.remedies(experiment_of(demo))
    assert [(row.scene, row.seed, row.share) for row in found] == [
        ("courtyard", 0, 1),
        ("courtyard_x0.5", 0, 0.5),
        ("courtyard_seed2", 2, 1),
        ("courtyard_seed2_x0.5", 2, 0.5),
    ]
    assert len({row.alike for row in found}) == 1
    # The flow of training views, where another round needed them.
    displacement = "results/courtyard/plain/round0/displacement/{}.csv"
    assert found[0].displacement == displacement.format("train")
    assert found[0].facts == "results/courtyard/facts.json"
    methods = [(method.method, method.round) for method in found[0].methods]
    assert methods == [("plain", 0), ("photos", 2), ("joint", 0)]
    # All that leads there is counted: three trainings, and renders and flow of two.
    assert len(found[0].methods[1].trainings) == 3
    assert len(found[0].methods[1].data) == 4
    # The same angle of error at half the size.
    half = {"downscale": 4, "perturb_px": 0.75}
    demo["scenes"]["small"] = demo["scenes"]["courtyard"] | half
    small = regimes.remedies(experiment_of(demo))[-1]
    assert small.alike != found[0].alike
    assert small.capture == found[0].capture
    del demo["scenes"]["small"]
    photos = demo["methods"].pop("photos")
    found = regimes.remedies(experiment_of(demo))
    assert found[0].displacement == displacement.format("test")
    demo["methods"]["photos"] = photos
    demo["vary"] = {"lengths": [0.5]}
    with pytest.raises(ValueError, match=r"scenes.courtyard_x0.5: it is never trained"):
        regimes.remedies(experiment_of(demo))
    demo["vary"] = None
    demo["methods"]["photos"]["rounds"] = "auto"
    with pytest.raises(ValueError, match=r"methods.photos.rounds: .* not auto"):
        regimes.remedies(experiment_of(demo))
    demo["methods"]["photos"] = {"model": "large"}
    with pytest.raises(ValueError, match="remedies need one model for all"):
        regimes.remedies(experiment_of(demo))
