"""flow.decompose and its table: the split is right where the truth is known."""

import csv

import numpy as np
import pandas as pd
import pytest

from alignerf.courtyard import rays as courtyard_rays
from alignerf.courtyard import scene as courtyard
from alignerf.scenes import cameras
from alignerf.tables import displacement
from flow import decompose
from flow.warping import files
from tests import table_cases

SIZE = WIDTH, HEIGHT = 80, 60
NO_TABLE = "not the table that it should be"
VIEWS = 4


@pytest.fixture(scope="module")
def world():
    return courtyard.build_world(seed=0)


@pytest.fixture
def views(world, tmp_path, request):
    """True flow and depth of a misaligned courtyard, on disk as the chain has them.

    Returns {view: the true camera part, the true part of motion}, both [h, w, 2].
    """
    motion, perturb_px = request.param
    pixtocams, true = courtyard.make_cameras(views=VIEWS, width=WIDTH, height=HEIGHT)
    rng = np.random.default_rng(3)
    given = cameras.perturb_poses(true, pixtocams, perturb_px, rng)
    shifts = courtyard.draw_displacements(views=VIEWS, motion=motion, motion_m=0.04)
    names, truth = [f"view_{i:03d}" for i in range(VIEWS)], {}
    for i, name in enumerate(names):
        oracle, photo = (pixtocams[i], given[i]), (pixtocams[i], true[i])
        flow_px, valid = courtyard.true_flow(world, oracle, photo, *SIZE, shifts[i])
        files.write_flow(tmp_path / "flow" / f"{name}.npz", flow_px, valid)
        x, y = courtyard.pixel_centres(*SIZE)
        hits = courtyard_rays.cast(world, *oracle, x, y, courtyard.at_rest())
        depth = hits.t.reshape(HEIGHT, WIDTH).astype(np.float32)
        (tmp_path / "depth").mkdir(exist_ok=True)
        np.savez(tmp_path / "depth" / f"{name}.npz", depth=depth)
        seen, _ = cameras.project(np.stack(courtyard_rays.ends(hits), -1), *photo)
        camera_px = (seen - np.stack([x, y], axis=-1)).reshape(HEIGHT, WIDTH, 2)
        truth[name] = camera_px, flow_px - camera_px
    np.savez(
        tmp_path / "cameras.npz", names=names, split=["test"] * 4, pixtocams=pixtocams
    )
    return truth


def command(folder, **changes):
    paths = {
        "renders-depth": folder / "depth",
        "flow": folder / "flow",
        "cameras": folder / "cameras.npz",
        "split": "test",
        "out-flow": folder / "parts",
        "stats-out": folder / "decomposition.csv",
    } | {name.replace("_", "-"): value for name, value in changes.items()}
    return [str(part) for name, value in paths.items() for part in (f"--{name}", value)]


def read_rows(folder):
    with open(folder / "decomposition.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        row.pop("view"): {k: float(v) if v else None for k, v in row.items()}
        for row in rows
    }


def mean_px(vectors, where):
    return np.linalg.norm(vectors[where], axis=-1).mean()


CASES = {"pose only": ("none", 1.5), "motion": ("uniform", 0), "both": ("uniform", 1.5)}


@pytest.mark.parametrize("views", CASES.values(), ids=CASES, indirect=True)
def test_each_part_is_the_true_one(views, tmp_path, request):
    """The issue asks for 15 %; with the true flow and depth it is far less."""
    assert decompose.run(command(tmp_path)) == 0
    rows, moves = read_rows(tmp_path), 0.0
    assert list(rows) == list(views)
    for view, (camera_px, motion_px) in views.items():
        parts = np.load(tmp_path / "parts" / f"{view}.npz")
        where, row = parts["valid"], rows[view]
        assert where.mean() > 0.7
        assert mean_px(parts["camera_px"] - camera_px, where) < 0.02
        assert mean_px(parts["remainder_px"] - motion_px, where) < 0.02
        true_px = mean_px(camera_px, where), mean_px(motion_px, where)
        np.testing.assert_allclose(row["camera_mean_px"], true_px[0], 0.02, 0.01)
        np.testing.assert_allclose(row["remainder_mean_px"], true_px[1], 0.05, 0.01)
        np.testing.assert_allclose(row["moved_mean_px"], true_px[1], 0.05, 0.01)
        moves = max(moves, true_px[1])
        if np.abs(motion_px[where]).max() < 1e-3:
            assert row["camera_fraction"] > 0.999
            assert row["moved_fraction"] == 0
        if np.abs(camera_px).max() < 1e-3:
            assert abs(row["camera_fraction"]) < 0.01
        assert row["model_mean_px"] is None
    # Else the case would show nothing.
    assert (moves > 0.1) == (request.node.callspec.id != "pose only")


@pytest.mark.parametrize("views", [("uniform", 1.5)], indirect=True)
def test_what_the_model_bent_is_taken_off_first(views, tmp_path, rng):
    assert decompose.run(command(tmp_path)) == 0
    plain = read_rows(tmp_path)
    for view in views:
        path = tmp_path / "flow" / f"{view}.npz"
        flow_px, valid = files.read_flow(path)
        y, x = np.indices(valid.shape) / 10
        bent_px = np.stack([np.sin(y + x), np.cos(y - x)], -1).astype(np.float32)
        files.write_flow(tmp_path / "bent" / f"{view}.npz", flow_px + bent_px, valid)
        files.write_flow(tmp_path / "model" / f"{view}.npz", bent_px, valid)
    flow = {"flow": tmp_path / "bent"}
    assert decompose.run(command(tmp_path, **flow)) == 0
    wrong = read_rows(tmp_path)
    assert decompose.run(command(tmp_path, model_flow=tmp_path / "model", **flow)) == 0
    for view, row in read_rows(tmp_path).items():
        for part in ("camera_mean_px", "remainder_mean_px", "camera_fraction"):
            assert row[part] == pytest.approx(plain[view][part], abs=1e-4)
        assert row["model_mean_px"] == pytest.approx(0.96, abs=0.1)
        assert row["flow_mean_px"] == pytest.approx(wrong[view]["flow_mean_px"])
        assert wrong[view]["remainder_mean_px"] > row["remainder_mean_px"] + 0.3
        assert "model_px" in np.load(tmp_path / "parts" / f"{view}.npz")


def test_explained_fraction():
    flow_px = np.array([3.0, 4.0, 5.0])
    assert decompose.explained(flow_px, 0 * flow_px) == 1
    assert decompose.explained(flow_px, flow_px) == 0
    assert decompose.explained(flow_px, 0.5 * flow_px) == pytest.approx(0.75, abs=0.01)
    assert decompose.explained(0 * flow_px, 0 * flow_px) == 0
    # One wild vector in a thousand says nothing.
    flow_px = np.r_[np.ones(999), 1e6]
    rest_px = np.r_[np.full(999, 0.1), 1e6]
    assert decompose.explained(flow_px, rest_px) == pytest.approx(0.989, abs=1e-3)


def small(folder, views=("a", "b c")):
    """Two views of a still camera, as small as files can be."""
    (folder / "depth").mkdir()
    for view in views:
        flow_px = np.ones((40, 50, 2), np.float32)
        files.write_flow(folder / "flow" / f"{view}.npz", flow_px, flow_px[..., 0] > 0)
        np.savez(folder / "depth" / f"{view}.npz", depth=np.ones((40, 50)))
    pixtocams = np.stack([cameras.intrinsics(40.0, 50, 40)] * len(views))
    np.savez(
        folder / "cameras.npz", names=views, split=["test"] * 2, pixtocams=pixtocams
    )


def lose_depth(folder):
    (folder / "depth" / "a.npz").unlink()


def small_depth(folder):
    np.savez(folder / "depth" / "b c.npz", depth=np.ones((4, 5)))


def no_depth(folder, views=("a", "b c")):
    for view in views:
        np.savez(folder / "depth" / f"{view}.npz", depth=np.full((40, 50), np.nan))


def nothing_valid(folder):
    flow_px = np.ones((40, 50, 2), np.float32)
    files.write_flow(folder / "flow" / "a.npz", flow_px, flow_px[..., 0] > 2)


def all_train(folder):
    stored = dict(np.load(folder / "cameras.npz"))
    np.savez(folder / "cameras.npz", **stored | {"split": ["train"] * 2})


def flat_camera(folder):
    stored = dict(np.load(folder / "cameras.npz"))
    np.savez(folder / "cameras.npz", **stored | {"pixtocams": np.zeros((2, 3, 3))})


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lose_depth, "depth/a.npz"),
        (small_depth, "view b c: depth (4, 5)"),
        (no_depth, "no view has both a valid flow and a depth"),
        (all_train, "cameras.npz: no view in split 'test'"),
        (flat_camera, "view a: pixtocam is singular"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(tmp_path, capsys, damage, reason):
    small(tmp_path)
    assert decompose.run(command(tmp_path)) == 0
    before = (tmp_path / "decomposition.csv").read_bytes()
    damage(tmp_path)
    assert decompose.run(command(tmp_path)) == 1
    error = capsys.readouterr().err.strip()
    assert error.startswith("error: ")
    assert "\n" not in error
    assert reason in error
    assert (tmp_path / "decomposition.csv").read_bytes() == before
    assert {p.name for p in (tmp_path / "parts").glob("*.npz")} == {"a.npz", "b c.npz"}


@pytest.mark.parametrize("lose", [nothing_valid, lambda one: no_depth(one, ["a"])])
def test_a_view_without_flow_or_depth_is_left_out(tmp_path, caplog, lose):
    """One whose flow has no pixel is told where its flow is estimated."""
    small(tmp_path)
    lose(tmp_path)
    assert decompose.run(command(tmp_path)) == 0
    assert len(caplog.messages) == (lose is not nothing_valid)
    assert all("depth in a: " in line for line in caplog.messages)
    path = tmp_path / "decomposition.csv"
    one, other = pd.read_csv(path).to_dict("records")
    assert np.isnan(one["flow_median_px"])
    row = table_cases.written(tmp_path, {"standard": [20.0] * 2}, "m")
    path.rename(row.files["parts"])
    scores = pd.read_csv(row.files["scores"]).assign(view=["a", "b c"])
    scores.to_csv(row.files["scores"], index=False)
    table = displacement.make_table(table_cases.collect(tmp_path, [row]))
    assert table["flow_median_px"].tolist() == [other["flow_median_px"]]
    assert table["views"].tolist() == [1]


def test_table_of_means_over_views(tmp_path):
    """What it writes is what `collect` reads, and the table of displacements."""
    small(tmp_path)
    assert decompose.run(command(tmp_path)) == 0
    path = tmp_path / "decomposition.csv"
    views = pd.read_csv(path)
    db = {"standard": [20.0] * len(views)}
    first, second = (table_cases.written(tmp_path, db, "a_b", k) for k in (0, 1))
    for row, lengths in ((first, views["flow_median_px"]), (second, [1.0, 3.0])):
        table = views.assign(flow_median_px=lengths)
        table.to_csv(row.files["parts"], index=False)
        scores = pd.read_csv(row.files["scores"]).assign(view=views["view"])
        scores.to_csv(row.files["scores"], index=False)
    table = displacement.make_table(table_cases.collect(tmp_path, [first, second]))
    assert table["round"].tolist() == [0, 1]
    assert table["views"].tolist() == [2, 2]
    assert table["flow_median_px"].tolist() == pytest.approx([2**0.5, 2.0], rel=1e-5)
    assert table["camera_fraction"][0] == pytest.approx(1, abs=1e-3)
    assert table["model_mean_px"].isna().all()
    tex = displacement.to_latex(table)
    assert "1.41" in tex
    assert r"a\_b" in tex
    assert "model" not in tex
    views.drop(columns="noise_px").to_csv(second.files["parts"], index=False)
    reason = f"decomposition_test.csv: {NO_TABLE}: no column noise_px"
    with pytest.raises(ValueError, match=reason):
        table_cases.collect(tmp_path, [first, second])
