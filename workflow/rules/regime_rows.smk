# Functions only: what stands in the table of regimes.
REGIMES = config.get("regimes", "alignerf_regimes")


def regime_scenes():
    """One entry per scene that has a baseline and what is set against it."""
    base = {base_of(method) for method in staged()}
    if len(base) != 1 or base & set(staged()):
        stop("config: methods: regimes need methods with alignerf, and one without")
    return [
        regime_of(name)
        | {
            "displacement": f"results/{name}/testset/displacement.csv",
            "methods": [
                row_files(name, method, round) | {"parts": field_name(method)}
                for method, round in regime_rounds(name, *base)
            ],
        }
        for name in config["scenes"]
    ]


def regime_rounds(scene, base):
    """(method, round) of every row: the baseline, the staged methods, warped photos.

    Trainings on these, of the baseline and then from its weights, are what the staged
    methods are to reach at less cost.
    """
    warped = [base, *(name for name in warm() if base_of(name) == base)]
    return [
        *((method, 0) for method in (base, *staged())),
        *(
            (method, round)
            for method in warped
            for round in range(1, last_round(scene, method) + 1)
        ),
    ]


def regime_of(name):
    """What a scene is like; of a real one only its name is known."""
    scene = config["scenes"][name]
    known = scene["source"] == "courtyard"
    motion = COURTYARD_MOTION | scene.get("courtyard", {})
    return {
        "scene": name,
        "seed": scene.get("seed", config["seed"]),
        # All that a regime is: scenes that have this in common differ in their seed.
        "alike": as_json({key: scene[key] for key in scene if key != "seed"}),
        "perturb_px": scene.get("perturb_px", 0),
        "motion_m": (
            (motion["motion"] != "none") * motion["motion_m"] if known else None
        ),
        "steps": training_of(config, name)["steps"],
    }


# As alignerf/poses.py has them; a test compares.
COURTYARD_MOTION = {"motion": "uniform", "motion_m": 0.02}


def regime_inputs(w):
    scenes = regime_scenes()
    methods = [method for scene in scenes for method in scene["methods"]]
    files = [[m["metrics"], *m["trainings"], *m["data"]] for m in methods]
    files += [[scene["displacement"]] for scene in scenes]
    return sorted({path for paths in files for path in paths})
