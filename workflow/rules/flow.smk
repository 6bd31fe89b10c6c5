# Functions only: settings of the flow, and what it is estimated of.
def flow_options(scene, method, round, split):
    """Command line of the flow's settings, for the views that it is estimated of."""
    flow = config["flow"]
    if flow["method"] != "files":
        return control_options()
    names = {"scene": scene, "method": method, "round": round, "split": split}
    folder = flow["folder"].format(**names)
    return [*control_options(), "--method", "files", "--flows", folder]


def reference_flow_options(scene):
    """The same for the warped test set."""
    method = config["reference"]["method"]
    return flow_options(scene, method, reference_round(scene), "test")


def control_options():
    """Command line of the estimator's settings, also for images that we make.

    For those no flows are made elsewhere: then it is the default estimator.
    """
    flow = config["flow"]
    blur = "--match-blur" if flow["match_blur"] else "--no-match-blur"
    pairs = {"--kernel": flow["kernel"], "--tolerance-px": flow["tolerance_px"]}
    if flow["method"] != "files":
        pairs["--method"] = flow["method"]
    return [blur, *(str(part) for pair in pairs.items() for part in pair)]


def flows_of_rounds(w):
    """The training views' flow after a round, and that of the round before."""
    k, flow = int(w.round), "flow/train"
    found = {"flow": f"{trained(w.scene, w.method, k)}/{flow}"}
    if k > 0:
        found["before_flow"] = f"{trained(w.scene, w.method, k - 1)}/{flow}"
        # The decision is the method's own, also where it starts from another's round.
        found["before"] = f"results/{w.scene}/{w.method}/round{k - 1}/decision.json"
    return found


def reference_views(scene, kind):
    """Renders or depth of the test views by the model that makes the warped test set."""
    folder = trained(scene, config["reference"]["method"], reference_round(scene))
    return f"{folder}/{kind}/test"


# Folders of flow.control_sets beside the warped test set.
CONTROL_SETS = (
    *("control", "placebo", "held_out"),
    *("aligned", "leak", "leak_flow", "leak_held_out"),
)


def model_flow_of(w):
    """The flow from render to oracle, where the scene's truth is known."""
    if w.scene not in with_truth():
        return {}
    return {"model": f"{trained(w.scene, w.method, w.round)}/flow_oracle/test"}


def flow_benchmark_models(scene):
    """<method>/round<k> of the reference method, before and after all warping."""
    method = config["reference"]["method"]
    rounds = sorted({0, last_round(scene, method)})
    found = [trained(scene, method, k) for k in rounds]
    return [folder.removeprefix(f"results/{scene}/") for folder in found]


def flow_benchmark_scene():
    """Command line of the scene with a truth, the config's first; or none."""
    return [
        part
        for name in with_truth()[:1]
        for part in (
            *("--scene", f"results/{name}"),
            *("--renders", *flow_benchmark_models(name)),
        )
    ]


def flow_benchmark_inputs(w):
    """Photos, truth and renders of that scene."""
    return [
        f"results/{name}/{path}"
        for name in with_truth()[:1]
        for path in (
            *("images", "truth"),
            *(f"{model}/renders/test" for model in flow_benchmark_models(name)),
        )
    ]
