"""What stands in the table of regimes (the paper's Table 4 is one of its blocks)."""

from alignerf.experiment import rows, settings, slices


def name(experiment):
    """What its files in results/ are called."""
    return experiment.config["regimes"]


def scenes(experiment):
    """One entry per scene that has a baseline and what is set against it.

    Raises ValueError for a config without them.
    """
    staged = experiment.staged()
    base = {experiment.base_of(method) for method in staged}
    if len(base) != 1 or base & set(staged):
        raise ValueError(
            "config: methods: regimes need methods with alignerf, and one without"
        )
    return [
        regime_of(experiment, scene)
        | {
            "displacement": f"results/{scene}/testset/displacement.csv",
            "methods": [
                rows.of_method(experiment, scene, method, round)
                | {"parts": rows.field_name(experiment, method)}
                for method, round in rounds(experiment, scene, *base)
            ],
        }
        for scene in experiment.scenes
    ]


def rounds(experiment, scene, base):
    """(method, round) of every row: the baseline, the staged methods, warped photos.

    Trainings on these, of the baseline and then from its weights, are what the staged
    methods are to reach at less cost.
    """
    going_on = [m for m in experiment.warm() if experiment.base_of(m) == base]
    return [
        *((method, 0) for method in (base, *experiment.staged())),
        *(
            (method, round)
            for method in (base, *going_on)
            for round in range(1, experiment.last_round(scene, method) + 1)
        ),
    ]


def regime_of(experiment, name):
    """What a scene is like; of a real one only its name is known."""
    scene = experiment.scenes[name]
    motion_m = None
    if settings.SOURCES[scene["source"]].has_truth:
        motion = scene["courtyard"]
        motion_m = (motion["motion"] != "none") * motion["motion_m"]
    return {
        "scene": name,
        "seed": scene["seed"],
        # All that a regime is: scenes that have this in common differ in their seed.
        "alike": slices.as_json({key: scene[key] for key in scene if key != "seed"}),
        "perturb_px": scene["perturb_px"],
        "motion_m": motion_m,
        "steps": scene["steps"],
    }
