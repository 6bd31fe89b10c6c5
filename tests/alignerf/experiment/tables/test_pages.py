"""What a scene's page is made from: windows, cameras that were put right."""

from alignerf.experiment.tables import pages


def options_of(experiment, scene):
    words = pages.options(experiment, scene)
    return dict(zip(words[::2], words[1::2], strict=True))


def of_demo(demo, methods, **more):
    """The demo with some of its methods, the first its reference."""
    return (
        demo
        | {
            "methods": methods,
            "reference": {"method": next(iter(methods)), "round": 0},
        }
        | more
    )


def test_a_method_that_aligns_itself_tells_how_the_cameras_moved(demo, experiment_of):
    methods = {"plain": {}, "aligned": {"align": {}}}
    experiment = experiment_of(of_demo(demo, methods, windows={"px": 96}))
    moved = "results/courtyard/aligned/round0/learnt"
    assert options_of(experiment, "courtyard") == {
        "--windows": "results/courtyard_windows/plain/round0",
        "--windows-corrected": "results/courtyard_windows_aligned/plain/round0",
        "--windows-by": "aligned",
        "--moved-by": "aligned",
        "--moved": f"{moved}/cameras.npz",
    }
    # The page waits for what it reads.
    files = pages.files(experiment, "courtyard")
    assert files["moved"] == moved
    assert files["train_warped"] == "results/courtyard/plain/round0/warped"
    windows = pages.of_windows(experiment, "courtyard")
    for scene in ("courtyard_windows", "courtyard_windows_aligned"):
        for kind in ("images", "cameras.npz", "plain/round0/renders"):
            assert f"results/{scene}/{kind}" in windows


def test_where_no_camera_moves_there_are_no_arrows(demo, experiment_of):
    experiment = experiment_of(of_demo(demo, {"plain": {}}))
    assert pages.options(experiment, "courtyard") == []
    assert "moved" not in pages.files(experiment, "courtyard")
    assert pages.of_windows(experiment, "courtyard") == []


def test_rounds_of_cameras_tell_it_too(demo, experiment_of):
    methods = {"moving": {"rounds": 1, "changes": "cameras"}}
    experiment = experiment_of(of_demo(demo, methods))
    found = options_of(experiment, "courtyard")
    assert found["--moved-by"] == "moving"
    assert found["--moved"].startswith("results/courtyard/moving/round1/")
    only_photos = {"photos": {"align": {"cameras_at": []}}, "plain": {}}
    experiment = experiment_of(of_demo(demo, only_photos))
    assert pages.moved_cameras(experiment, "courtyard") is None


def test_of_judged_renders_their_flow_tells_it(experiment_of, tmp_path):
    renders = str(tmp_path)

    def judging(**changes):
        judged = {
            "renders": renders,
            "cameras": renders,
            "splits": ["train"],
        } | changes
        scene = {"source": "judged", "path": str(tmp_path), "judged": judged}
        return experiment_of(
            {
                "scenes": {"mine": scene},
                "methods": {"theirs": {"external": {"renders": renders}}},
                "reference": {"method": "theirs", "round": 0},
            }
        )

    assert pages.moved_cameras(judging(), "mine") == (
        "flow",
        "results/mine/theirs/round0/corrected/cameras.npz",
    )
    assert pages.moved_cameras(judging(cameras=None), "mine") is None
    assert pages.moved_cameras(judging(splits=["test"]), "mine") is None
