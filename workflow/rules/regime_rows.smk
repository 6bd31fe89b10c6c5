# Functions only: what stands in the table of regimes.
REGIMES = config.get("regimes", "alignerf_regimes")


def regime_scenes():
    """One entry per scene that has a baseline and what is set against it.

    Last stand trainings on warped photos, of the baseline and from its weights, if the
    config has any: what the staged methods are to reach at less cost.
    """
    base = {base_of(method) for method in staged()}
    if len(base) != 1 or base & set(staged()):
        stop("config: methods: regimes need methods with alignerf, and one without")
    return [
        regime_of(name)
        | {
            "displacement": f"results/{name}/testset/displacement.csv",
            "methods": [
                regime_method(name, method, round)
                for method, round in [
                    *((method, 0) for method in (*base, *staged())),
                    *((m, k) for m, k in all_rounds(name) if k and base_of(m) in base),
                ]
            ],
        }
        for name in config["scenes"]
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


def regime_method(scene, method, round):
    """The files of one method and round of one scene."""
    return {
        "method": method,
        "round": round,
        "parts": field_name(method),
        "metrics": f"{trained(scene, method, round)}/metrics.csv",
        "trainings": trainings_of(scene, method, round),
        "data": data_of(scene, method, round),
    }


def regime_inputs(w):
    scenes = regime_scenes()
    methods = [method for scene in scenes for method in scene["methods"]]
    files = [[m["metrics"], *m["trainings"], *m["data"]] for m in methods]
    files += [[scene["displacement"]] for scene in scenes]
    return sorted({path for paths in files for path in paths})
