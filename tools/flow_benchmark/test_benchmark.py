"""The pairs are what they say, the scores are right, files whole."""

import cv2
import numpy as np
import pandas as pd
import pytest

from alignerf.io import images
from flow.warping import files, warp
from tools.flow_benchmark import __main__ as benchmark
from tools.flow_benchmark import pairs as benchmark_pairs

FLOW_PX = (3, -2)
COFFEE = {"coffee": benchmark_pairs.PHOTOS["coffee"]}


def small_texture(height, width, seed):
    noise = np.random.default_rng(seed).normal(size=(height, width, 3))
    image = cv2.GaussianBlur(noise, (0, 0), 1.5)
    return np.clip(127 + 40 * image / image.std(), 0, 255).astype(np.uint8)


def cut(seed=0):
    """render(x) = photo(x + FLOW_PX) by indexing, and the flow."""
    dx, dy = FLOW_PX
    large = small_texture(84, 104, seed)
    photo = large[10:74, 10:94]
    render = large[10 + dy : 74 + dy, 10 + dx : 94 + dx]
    return render, photo, np.full((64, 84, 2), FLOW_PX, np.float32)


@pytest.fixture
def middlebury(tmp_path):
    """A sequence in Middlebury's layout."""
    render, photo, flow_px = cut()
    folder = tmp_path / "middlebury" / "Cut"
    images.write(folder / "frame10.png", render)
    images.write(folder / "frame11.png", photo)
    size = np.array([84, 64], "<i4").tobytes()
    (folder / "flow10.flo").write_bytes(b"PIEH" + size + flow_px.tobytes())
    return folder.parent


@pytest.fixture
def scene(tmp_path):
    """A scene with truth, one view, and a model that renders the oracle blurred."""
    folder = tmp_path / "yard"
    oracle, photo, flow_px = cut(1)
    images.write(folder / "images" / "v.png", photo)
    images.write(folder / "images" / "truth" / "oracle" / "v.png", oracle)
    valid = np.ones(flow_px.shape[:2], bool)
    files.write_flow(folder / "images" / "truth" / "flow" / "v.npz", flow_px, valid)
    render = cv2.GaussianBlur(oracle, (0, 0), 1.0)
    images.write(folder / "nerf/round0/renders/test/v.png", render)
    return folder


@pytest.fixture
def few(monkeypatch):
    """One photo, two flows, one blur; no stereo pair, no other folders."""
    part = {"astronaut": np.s_[0:96, 150:270]}

    def synthetic(make=benchmark_pairs.synthetic):
        return make(part, lengths_px=(0.5, 2.0), blurs_px=(0.0, 2.0))

    def stereo():
        raise OSError("no network")

    monkeypatch.setattr(benchmark_pairs, "synthetic", synthetic)
    monkeypatch.setattr(benchmark_pairs, "stereo", stereo)
    monkeypatch.delenv("ALIGNERF_DATA", raising=False)


def residual(pair):
    """Grey levels by which the photo warped by the truth misses the render."""
    warped = warp.warp(pair.photo, pair.true_px).astype(float)
    inner = pair.known.copy()
    inner[:8] = inner[-8:] = inner[:, :8] = inner[:, -8:] = False
    return np.abs(warped - pair.render)[inner].mean()


def test_true_flows_lead_from_render_to_photo(middlebury, scene):
    pairs = [
        *benchmark_pairs.middlebury(middlebury),
        *benchmark_pairs.stereo(),
        *benchmark_pairs.scene(scene, ["nerf/round0"]),
        *benchmark_pairs.synthetic(COFFEE, lengths_px=(8.0,), blurs_px=(0.0, 1.0)),
    ]
    assert len(pairs) == 1 + 1 + 2 + 3
    for pair in pairs:
        moved = pair._replace(true_px=np.zeros_like(pair.true_px))
        if pair.data.startswith("overfit"):
            assert not pair.true_px.any()
            continue
        assert residual(pair) < 0.7 * residual(moved)
        turned = pair._replace(true_px=-pair.true_px)
        assert residual(pair) < 0.7 * residual(turned)


def test_synthetic_pairs_have_the_lengths_and_blurs_of_their_names():
    pairs = list(benchmark_pairs.synthetic(COFFEE, (0.25, 4.0), (0.0, 2.0)))
    assert len(pairs) == 5
    for pair in pairs:
        longest = np.linalg.norm(pair.true_px, axis=-1).max()
        assert pair.name == f"coffee {longest:.4g} px"
        assert pair.data.startswith("overfit") == (longest == 0)
        detail = [cv2.Laplacian(i, cv2.CV_64F).std() for i in (pair.render, pair.photo)]
        assert (detail[0] < 0.5 * detail[1]) == ("blurred 2 px" in pair.data)


def test_score_by_hand():
    found_px = np.zeros((2, 3, 2), np.float32)
    true_px = found_px.copy()
    true_px[0, :, 0] = (0.2, 0.5, 3.0)
    true_px[1] = (0, 100)
    known = np.array([[True] * 3, [False] * 3])
    mean_px, *shares = benchmark.score(found_px, true_px, known)
    assert mean_px == pytest.approx(3.7 / 3)
    assert shares == pytest.approx([1 / 3, 2 / 3, 2 / 3])
    with pytest.raises(ValueError, match="no pixel has a known flow"):
        benchmark.score(found_px, true_px, known & False)


def arguments(out, *more):
    return [f"--csv={out / 'b.csv'}", "--methods", "dis_fast", "dis_medium", *more]


def test_the_whole_table(few, middlebury, scene, tmp_path, caplog):
    caplog.set_level("INFO", "alignerf")
    models = ("--scene", str(scene), "--renders", "nerf/round0")
    where = ("--middlebury", str(middlebury), *models)
    assert benchmark.run(arguments(tmp_path / "out", *where)) == 0
    table = pd.read_csv(tmp_path / "out" / "b.csv")
    assert tuple(table.columns) == benchmark.COLUMNS
    data = ["middlebury", "overfit blurred 2 px", "smooth sharp", "smooth blurred 2 px"]
    data += ["yard round0", "overfit yard round0"]
    assert list(dict.fromkeys(table["data"])) == data
    assert len(table) == len(data) * 4
    assert table["note"].isna().all()
    assert (table["mpx_per_s"] > 0).all()
    shares = table[list(benchmark.WITHIN_PX)].to_numpy()
    assert ((shares >= 0) & (shares <= 1)).all()
    assert (np.diff(shares, axis=1) >= 0).all()
    scores = table.set_index(["data", "method", "match_blur"])["epe_px"]
    # What a wrong direction or a swapped pair would cost: the flow is 3.6 px long.
    assert scores["middlebury", "dis_fast", False] < 0.5
    assert scores["yard round0", "dis_fast", True] < 0.5
    assert scores["overfit yard round0", "dis_fast", True] < 0.5
    assert "left out: the stereo pair, no network" in caplog.text
    assert "left out: Middlebury" not in caplog.text


def test_what_is_not_there_is_said(few, tmp_path, caplog):
    caplog.set_level("INFO", "alignerf")
    assert benchmark.run(arguments(tmp_path / "out")) == 0
    said = [record.getMessage() for record in caplog.records]
    for what in ("Middlebury's sequences", "the stereo pair", "renders of a scene"):
        assert sum(line.startswith(f"left out: {what}") for line in said) == 1
    assert len(pd.read_csv(tmp_path / "out" / "b.csv")) == 3 * 4


def sequences(monkeypatch, caplog, given=None):
    """The names of Middlebury's pairs that are found, and what is said of them."""
    monkeypatch.setattr(benchmark_pairs, "synthetic", list)
    monkeypatch.setattr(benchmark_pairs, "stereo", list)
    caplog.clear()
    found = benchmark.find_sources(given, None, (), "test")
    names = [pair.name for source in found for pair in source]
    said = [text for *_, text in caplog.record_tuples]
    return names, [text for text in said if "Middlebury" in text]


def test_sequences_are_those_of_the_data_folder(middlebury, monkeypatch, caplog):
    """What is given goes before; a missing folder takes one line to mend."""
    data = middlebury.parent / "data"
    monkeypatch.setenv("ALIGNERF_DATA", str(data))
    names, (line,) = sequences(monkeypatch, caplog)
    assert not names
    assert line.startswith(f"left out: Middlebury's sequences, {data} holds no folder")
    monkeypatch.delenv("ALIGNERF_DATA")
    names, (line,) = sequences(monkeypatch, caplog)
    assert not names
    assert "sequences, ALIGNERF_DATA is not set (give --middlebury DIR, or" in line
    assert sequences(monkeypatch, caplog, middlebury) == (["Cut"], [])
    data.mkdir()
    middlebury.rename(data / "flow")
    monkeypatch.setenv("ALIGNERF_DATA", str(data))
    assert sequences(monkeypatch, caplog) == (["Cut"], [])


def test_no_path_leads_out_of_the_checkout(root):
    """Where data lies is a user's to say."""
    for package in ("alignerf", "flow"):
        for path in (root / package).rglob("*.py"):
            assert "../" not in path.read_text(), path


def test_a_refusal_leaves_the_scores_empty_and_is_noted(tmp_path):
    flat = np.full((40, 50, 3), 7, np.uint8)
    photo = small_texture(40, 50, 0)
    nowhere = np.zeros((40, 50, 2), np.float32)
    known = np.ones((40, 50), bool)
    pairs = [benchmark_pairs.Pair("flat", "one", flat, photo, nowhere, known)]
    row = benchmark.means(pairs, "simpleflow", False)
    assert row == {"note": "one: simpleflow gave a flow that is not finite"}
    rows = [
        {"data": "flat", "method": "simpleflow", "match_blur": False, "pairs": 1} | row,
        {"data": "flat", "method": "tvl1", "match_blur": False, "pairs": 1, "note": ""}
        | dict.fromkeys((*benchmark.SCORES, "mpx_per_s"), 0.5),
    ]
    table = pd.DataFrame(rows, columns=benchmark.COLUMNS)
    benchmark.write(table, tmp_path / "b.csv", ())
    assert pd.read_csv(tmp_path / "b.csv")["epe_px"].isna().tolist() == [True, False]


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        (("--middlebury", "nowhere"), "nowhere: no sequence"),
        (("--scene", "nowhere", "--renders", "m/round0"), "renders/test: no renders"),
    ],
)
def test_bad_folders_end_in_one_line_and_nothing_written(
    few, tmp_path, capsys, more, reason
):
    assert benchmark.run(arguments(tmp_path / "out", *more)) == 1
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("error: ")
    assert reason in error
    assert not (tmp_path / "out").exists()


def test_scene_and_renders_go_together(tmp_path, capsys):
    with pytest.raises(SystemExit, match="2"):
        benchmark.run(arguments(tmp_path, "--scene", "x"))
    assert "--scene and --renders go together" in capsys.readouterr().err
