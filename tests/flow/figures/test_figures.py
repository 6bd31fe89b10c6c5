"""flow.figures.scene: what they show of a scene, and what they need."""

import json

import cv2
import numpy as np
import pytest

from flow.figures import drawing
from flow.figures import parts as part_figures
from flow.figures import scene as scene_figures
from flow.warping import files


@pytest.fixture
def scene(tmp_path, rng):
    """Two views as the chain leaves them, of 40x30 pixels."""
    for view in ("a", "b c"):
        for folder in ("photos", "renders"):
            image = rng.integers(0, 256, (30, 40, 3), dtype=np.uint8)
            files.write_image(tmp_path / folder / f"{view}.png", image)
        flow_px = rng.normal(size=(30, 40, 2)).astype(np.float32)
        valid = rng.uniform(size=(30, 40)) < 0.9
        files.write_flow(tmp_path / "testset" / "flow" / f"{view}.npz", flow_px, valid)
    statistics = "view,median_px\na,1.5\nb c,0.5\n"
    (tmp_path / "testset" / "displacement.csv").write_text(statistics)
    return tmp_path


def draw(scene, *extra, rounds=2):
    """The figures of the scene, as if each round had rendered the same."""
    again = {"renders": str(scene / "renders"), "flow": str(scene / "testset" / "flow")}
    return scene_figures.run(
        [
            *("--photos", str(scene / "photos"), "--testset", str(scene / "testset")),
            *("--reference", str(scene / "renders")),
            *("--rounds", json.dumps([again] * rounds)),
            *("--flow-figure", str(scene / "figures" / "flow.png")),
            *("--rounds-figure", str(scene / "figures" / "rounds.png")),
            *extra,
        ]
    )


def size(path):
    height, width = cv2.imread(str(path)).shape[:2]
    return width, height


def test_figures_of_a_scene(scene):
    assert draw(scene) == 0
    assert {p.name for p in (scene / "figures").iterdir()} == {"flow.png", "rounds.png"}
    width, height = size(scene / "figures" / "flow.png")
    assert width > 3 * height > 900
    first = size(scene / "figures" / "rounds.png")
    assert draw(scene, rounds=3) == 0
    more = size(scene / "figures" / "rounds.png")
    assert more[1] == first[1] > 600
    assert more[0] == pytest.approx(4 / 3 * first[0], rel=0.01)


def test_the_view_of_middle_misalignment_is_shown(tmp_path):
    path = tmp_path / "displacement.csv"
    for lengths, wanted in (([3, 1, 2], "c"), ([10, 9, 0, 0.5], "b"), ([1], "a")):
        lines = [f"{view},{px}" for view, px in zip("abcd", lengths, strict=False)]
        path.write_text("\n".join(["view,median_px", *lines]))
        assert scene_figures.middle_view(path) == wanted


def test_the_scale_leaves_out_what_is_not_valid():
    flow_px = np.zeros((10, 10, 2), np.float32)
    flow_px[:, :5] = [3.0, 4.0]
    flow_px[0, 0] = [1000.0, 0.0]
    valid = np.ones((10, 10), bool)
    valid[0, 0] = False
    assert drawing.flow_scale([(flow_px, valid)]) == 5.0
    assert drawing.median_px((flow_px[:, :5], valid[:, :5])) == 5.0
    assert drawing.flow_scale([(0 * flow_px, valid)]) == 0.1
    colours = drawing.coloured((flow_px, valid), 5.0)
    assert colours.shape == (10, 10, 3)
    assert not colours[0, 0].any()
    assert len(np.unique(colours[1:, :5].reshape(-1, 3), axis=0)) == 1


def lose_renders(scene):
    for path in (scene / "renders").iterdir():
        path.unlink()


def lose_statistics(scene):
    (scene / "testset" / "displacement.csv").unlink()


def empty_statistics(scene):
    (scene / "testset" / "displacement.csv").write_text("view,median_px\n")


def cut_flow(scene):
    for path in (scene / "testset" / "flow").iterdir():
        path.write_bytes(path.read_bytes()[:300])


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lose_statistics, "displacement.csv"),
        (empty_statistics, "displacement.csv: no view"),
        (cut_flow, "not the .npz that it should be"),
        (lose_renders, "renders/"),
    ],
)
def test_no_figure_without_its_input(scene, capsys, damage, reason):
    damage(scene)
    assert draw(scene) == 1
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("error: ")
    assert reason in error
    assert not list(scene.glob("figures/*"))


PART_FIGURES = ("views", "lengths", "curves")


def with_parts(scene, rng, *, model=True, rounds=3):
    """The options of the figures of parts, and their files as the chain has them."""
    (scene / "parts").mkdir(exist_ok=True)
    names = ["camera_px", "remainder_px", *(["model_px"] if model else [])]
    for view in ("a", "b c"):
        parts = {
            name: rng.normal(size=(30, 40, 2)).astype(np.float32) for name in names
        }
        valid = rng.uniform(size=(30, 40)) < 0.9
        np.savez(scene / "parts" / f"{view}.npz", valid=valid, **parts)
    rows = []
    for k in range(rounds):
        stats, metrics = scene / f"stats{k}.csv", scene / f"metrics{k}.csv"
        stats.write_text(f"view,flow_median_px\na,{2 - k}\nb c,{4 - k}\n")
        metrics.write_text(
            f"view,test_set,psnr_db\na,standard,{20 + k}\nb c,standard,{22 + k}\n"
        )
        row = {"method": "m", "round": k, "stats": str(stats), "metrics": str(metrics)}
        rows.append(row)
    options = ["--parts", str(scene / "parts"), "--curves", json.dumps(rows)]
    for name in PART_FIGURES:
        options += [f"--{name}-figure", str(scene / "figures" / f"{name}.png")]
    return options


def test_figures_of_the_parts(scene, rng):
    assert draw(scene, *with_parts(scene, rng)) == 0
    found = {path.stem for path in (scene / "figures").iterdir()}
    assert found == {"flow", "rounds", *PART_FIGURES}
    # At the width of a page, whatever the number of columns.
    for model in (True, False):
        assert draw(scene, *with_parts(scene, rng, model=model)) == 0
        assert size(scene / "figures" / "views.png")[0] == 1080
    sizes = {name: size(scene / "figures" / f"{name}.png") for name in PART_FIGURES}
    assert sizes["lengths"] == (750, 450)
    assert sizes["curves"] == (1080, 420)


def test_parts_add_up_to_the_flow(scene, rng):
    with_parts(scene, rng, model=True)
    parts = part_figures.read_parts(scene / "parts")
    assert list(parts) == ["a", "b c"]
    assert part_figures.present(parts) == list(part_figures.TITLES)
    view = parts["b c"]
    np.testing.assert_allclose(
        view["flow_px"], view["camera_px"] + view["remainder_px"] + view["model_px"]
    )
    with_parts(scene, rng, model=False)
    without = part_figures.read_parts(scene / "parts")
    assert "model_px" not in part_figures.present(without)
    # A part that some view lacks is not shown for the others.
    mixed = {"a": parts["a"], "b c": without["b c"]}
    assert part_figures.present(mixed) == ["flow_px", "camera_px", "remainder_px"]


def test_curves_are_means_over_views(scene, rng):
    options = with_parts(scene, rng)
    rows = json.loads(options[options.index("--curves") + 1])
    table = part_figures.read_rounds(rows)
    assert table["median_px"].tolist() == [3, 2, 1]
    assert table["standard"].tolist() == [21, 22, 23]
    assert "oracle" not in table


def lose_parts(scene):
    for path in (scene / "parts").iterdir():
        path.unlink()


def cut_parts(scene):
    path = scene / "parts" / "a.npz"
    path.write_bytes(path.read_bytes()[:100])


def empty_metrics(scene):
    (scene / "metrics1.csv").write_text("view,test_set,psnr_db\n")


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lose_parts, "parts: no parts"),
        (cut_parts, "parts/a.npz: not the .npz that it should be"),
        (empty_metrics, "metrics1.csv: no psnr_db"),
    ],
)
def test_no_figure_of_broken_parts(scene, rng, capsys, damage, reason):
    options = with_parts(scene, rng)
    damage(scene)
    assert draw(scene, *options) == 1
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("error: ")
    assert reason in error


def test_options_of_the_parts_go_together(scene, rng):
    with pytest.raises(SystemExit):
        draw(scene, *with_parts(scene, rng)[:2])
