"""flow.figures.scene: what they show of a scene, and what they need."""

import json

import cv2
import numpy as np
import pytest

from alignerf.io import images
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
            images.write(tmp_path / folder / f"{view}.png", image)
        flow_px = rng.normal(size=(30, 40, 2)).astype(np.float32)
        valid = rng.uniform(size=(30, 40)) < 0.9
        files.write_flow(tmp_path / "testset" / "flow" / f"{view}.npz", flow_px, valid)
    statistics = "view,median_px\na,1.5\nb c,0.5\n"
    (tmp_path / "testset" / "displacement.csv").write_text(statistics)
    return tmp_path


def write_parts(scene, rng, *, model=True):
    """The parts of the views; returns the path of the scores of a method's rounds."""
    (scene / "parts").mkdir(exist_ok=True)
    names = ["camera_px", "remainder_px", *(["model_px"] if model else [])]
    for view in ("a", "b c"):
        parts = {
            name: rng.normal(size=(30, 40, 2)).astype(np.float32) for name in names
        }
        valid = rng.uniform(size=(30, 40)) < 0.9
        np.savez(scene / "parts" / f"{view}.npz", valid=valid, **parts)
    return write_scores(scene)


def write_scores(scene, **changes):
    """Three rounds' scores, and renders that are given; changes: {place: its value}."""
    lines = ["method,round,test_set,view,metric,value", "given,0,standard,a,psnr_db,9"]
    for k in range(3):
        values = {"a_psnr_db": 20 + k, "b_psnr_db": 22 + k}
        values |= {"a_flow_median_px": 2 - k, "b_flow_median_px": 4 - k}
        for key, value in values.items():
            view, _, metric = key.partition("_")
            name = {"a": "a", "b": "b c"}[view]
            value = changes.get(f"{key}_{k}", value)
            lines.append(f"m,{k},standard,{name},{metric},{value}")
    lines.append("m,1,oracle,a,psnr_db,30\nm,1,oracle,b c,psnr_db,32\n")
    path = scene / "scores.csv"
    path.write_text("\n".join(lines))
    return path


def arguments(scene, curves, rounds=2):
    """The command's, as if each round had rendered the same."""
    again = {"renders": str(scene / "renders"), "flow": str(scene / "testset" / "flow")}
    options = {
        "photos": scene / "photos",
        "testset": scene / "testset",
        "reference": scene / "renders",
        "rounds": json.dumps([again] * rounds),
        "parts": scene / "parts",
        "curves": curves,
        "out": scene / "figures",
    }
    return {f"--{name}": str(value) for name, value in options.items()}


def draw(scene, curves, rounds=2, **more):
    options = arguments(scene, curves, rounds) | more
    return scene_figures.run([part for option in options.items() for part in option])


def size(path):
    height, width = cv2.imread(str(path)).shape[:2]
    return width, height


def test_figures_of_a_scene(scene, rng):
    curves = write_parts(scene, rng)
    assert draw(scene, curves) == 0
    found = {path.stem for path in (scene / "figures").iterdir()}
    assert found == set(scene_figures.FIGURES)
    width, height = size(scene / "figures" / "flow.png")
    assert width > 3 * height > 900
    first = size(scene / "figures" / "rounds.png")
    assert draw(scene, curves, rounds=3) == 0
    more = size(scene / "figures" / "rounds.png")
    assert more[1] == first[1] > 600
    assert more[0] == pytest.approx(4 / 3 * first[0], rel=0.01)


def test_crops_come_with_the_methods_that_they_show(scene, rng):
    method = {"method": "m", "renders": str(scene / "renders")}
    method["flow"] = str(scene / "testset" / "flow")
    crops = {"--crops": json.dumps([method])}
    assert draw(scene, write_parts(scene, rng), **crops) == 0
    found = {path.stem for path in (scene / "figures").iterdir()}
    assert found == {*scene_figures.FIGURES, "crops"}


def test_the_view_of_middle_misalignment_is_shown(tmp_path):
    path = tmp_path / "displacement.csv"
    for lengths, wanted in (([3, 1, 2], "c"), ([10, 9, 0, 0.5], "b"), ([1], "a")):
        lines = [f"{view},{px}" for view, px in zip("abcd", lengths, strict=False)]
        path.write_text("\n".join(["view,median_px", *lines, ""]))
        assert scene_figures.middle_view(path) == wanted


def test_the_scale_leaves_out_what_is_not_valid():
    flow_px = np.zeros((10, 10, 2), np.float32)
    flow_px[:, :5] = [3.0, 4.0]
    flow_px[0, 0] = [1000.0, 0.0]
    valid = np.ones((10, 10), bool)
    valid[0, 0] = False
    assert drawing.flow_scale([(flow_px, valid)]) == 5.0
    assert drawing.median((flow_px[:, :5], valid[:, :5])) == "5.00 px"
    assert drawing.median((flow_px, np.zeros_like(valid))) == "no valid flow"
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
        (empty_statistics, "displacement.csv: not the table that it should be: no row"),
        (cut_flow, "not the .npz that it should be"),
        (lose_renders, "renders/"),
    ],
)
def test_no_figure_without_its_input(scene, rng, capsys, damage, reason):
    curves = write_parts(scene, rng)
    damage(scene)
    assert draw(scene, curves) == 1
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("error: ")
    assert reason in error
    assert not list(scene.glob("figures/*"))


def test_figures_of_the_parts(scene, rng):
    # At the width of a page, where there is a model's part and where there is none.
    for model in (True, False):
        assert draw(scene, write_parts(scene, rng, model=model)) == 0
    assert size(scene / "figures" / "lengths.png") == (750, 450)
    assert size(scene / "figures" / "curves.png") == (1080, 420)


def test_parts_add_up_to_the_flow(scene, rng):
    write_parts(scene, rng, model=True)
    parts = part_figures.read_parts(scene / "parts")
    assert list(parts) == ["a", "b c"]
    assert part_figures.present(parts) == list(part_figures.TITLES)
    view = parts["b c"]
    np.testing.assert_allclose(
        view["flow_px"], view["camera_px"] + view["remainder_px"] + view["model_px"]
    )
    write_parts(scene, rng, model=False)
    without = part_figures.read_parts(scene / "parts")
    assert "model_px" not in part_figures.present(without)
    # A part that some view lacks is not shown for the others.
    mixed = {"a": parts["a"], "b c": without["b c"]}
    assert part_figures.present(mixed) == ["flow_px", "camera_px", "remainder_px"]


def test_curves_are_means_over_views(scene, rng):
    table = part_figures.read_rounds(write_parts(scene, rng))
    # Of renders that are given there is no flow.
    assert table[["method", "round"]].values.tolist() == [["m", k] for k in range(3)]
    assert table["median_px"].tolist() == [3, 2, 1]
    assert table["standard"].tolist() == [21, 22, 23]
    assert table["oracle"].isna().tolist() == [True, False, True]


def test_a_view_without_a_number_leaves_the_mean_empty(scene, rng, caplog):
    """The easier views that are left would flatter it."""
    curves = write_parts(scene, rng)
    assert not part_figures.read_rounds(curves)["standard"].isna().any()
    assert not caplog.records
    write_scores(scene, b_psnr_db_1="", b_flow_median_px_1="")
    table = part_figures.read_rounds(curves)
    assert table["median_px"].isna().tolist() == [False, True, False]
    assert table["standard"].isna().tolist() == [False, True, False]
    assert table["oracle"][1] == 31
    said = [record.getMessage() for record in caplog.records]
    assert said == [
        f"{curves}: no {metric} of m, round 1 in b c: its mean is left empty"
        for metric in ("flow_median_px", "psnr_db")
    ]
    assert draw(scene, curves) == 0
    write_scores(scene, **{f"a_flow_median_px_{k}": "" for k in range(3)})
    assert draw(scene, curves) == 0


def lose_parts(scene):
    for path in (scene / "parts").iterdir():
        path.unlink()


def cut_parts(scene):
    path = scene / "parts" / "a.npz"
    path.write_bytes(path.read_bytes()[:100])


def empty_scores(scene):
    (scene / "scores.csv").write_text("method,round,test_set,view,metric,value\n")


def no_flow(scene):
    path = scene / "scores.csv"
    path.write_text(path.read_text().replace("flow_median_px", "flow_mean_px"))


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lose_parts, "parts: no parts"),
        (cut_parts, "parts/a.npz: not the .npz that it should be"),
        (empty_scores, "scores.csv: not the table that it should be: no row"),
        (no_flow, "scores.csv: no flow_median_px of any method"),
    ],
)
def test_no_figure_of_broken_parts(scene, rng, capsys, damage, reason):
    curves = write_parts(scene, rng)
    damage(scene)
    assert draw(scene, curves) == 1
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("error: ")
    assert reason in error


@pytest.mark.parametrize(
    ("option", "text"),
    [("--rounds", "0"), ("--rounds", "[]"), ("--rounds", "x"), ("--crops", "[{}]")],
)
def test_rows_that_are_none_are_named(option, text, scene, rng, capsys):
    """Found by the torture: a traceback."""
    assert draw(scene, write_parts(scene, rng), **{option: text}) == 1
    assert capsys.readouterr().err.splitlines()[-1].startswith(f"error: {option}")
