"""Flows made elsewhere, alone and through `flow.align --method files`."""

import csv

import cv2
import numpy as np
import pytest

from alignerf.io import images
from flow import align
from flow.estimation import external
from flow.warping import files, warp

SHAPE = (40, 56)


def shift_flow(dx, dy, shape=SHAPE):
    return np.full((*shape, 2), (dx, dy), np.float32)


def write_flo(path, flow_px):
    """Middlebury's format, by its description."""
    h, w = flow_px.shape[:2]
    path.parent.mkdir(parents=True, exist_ok=True)
    header = b"PIEH" + np.array([w, h], "<i4").tobytes()
    path.write_bytes(header + flow_px.astype("<f4").tobytes())


@pytest.mark.parametrize("suffix", [".flo", ".npz"])
def test_reads_the_flow_and_what_is_unknown(tmp_path, suffix):
    flow_px = np.random.default_rng(0).normal(size=(*SHAPE, 2)).astype(np.float32)
    expected = np.ones(SHAPE, bool)
    for place, value in (((3, 4, 0), 1e10), ((5, 6, 1), np.nan), ((7, 8), np.inf)):
        flow_px[place] = value
        expected[place[:2]] = False
    path = tmp_path / f"a{suffix}"
    if suffix == ".flo":
        write_flo(path, flow_px)
    else:
        valid = np.ones(SHAPE, bool)
        valid[9] = expected[9] = False
        np.savez(path, flow_px=flow_px.astype(np.float64), valid=valid)
    found_px, known = external.read(tmp_path, "a", SHAPE)
    np.testing.assert_array_equal(known, expected)
    np.testing.assert_array_equal(found_px[known], flow_px[known])
    assert not found_px[~known].any()
    assert found_px.dtype == np.float32


def test_validity_without_a_flow_back_is_the_frame_and_the_mask(tmp_path):
    known = np.ones(SHAPE, bool)
    known[10:12] = False
    np.savez(tmp_path / "a.npz", flow_px=shift_flow(3, 0), valid=known)
    _, valid = external.flow_and_validity(tmp_path, "a", SHAPE, tolerance_px=1.0)
    expected = known.copy()
    expected[:, -3:] = False
    np.testing.assert_array_equal(valid, expected)


def test_validity_with_a_flow_back_is_its_answer(tmp_path):
    np.savez(tmp_path / "a.npz", flow_px=shift_flow(2, 1))
    back_px = shift_flow(-2, -1)
    back_px[20:24, 30:36] = 1e10  # unknown
    back_px[8:10, 8:10] = (5, 5)  # disagrees
    write_flo(tmp_path / "a.back.flo", back_px)
    _, valid = external.flow_and_validity(tmp_path, "a", SHAPE, tolerance_px=0.5)
    expected = np.ones(SHAPE, bool)
    expected[:, -2:] = expected[-1:] = False
    # A pixel up and two to the left: where the render's pixels ask.
    expected[19:23, 28:34] = expected[7:9, 6:8] = False
    np.testing.assert_array_equal(valid, expected)


def no_file(folder):
    (folder / "a.npz").unlink()


def two_files(folder):
    write_flo(folder / "a.flo", shift_flow(1, 0))


def wrong_size(folder):
    np.savez(folder / "a.npz", flow_px=shift_flow(1, 0, (40, 55)))


def cut_file(folder):
    (folder / "a.npz").write_bytes((folder / "a.npz").read_bytes()[:100])


def wrong_kind(folder):
    np.savez(folder / "a.npz", flow_px=np.zeros((*SHAPE, 2), int))


def wrong_mask(folder):
    np.savez(folder / "a.npz", flow_px=shift_flow(1, 0), valid=np.ones(SHAPE))


def wrong_key(folder):
    np.savez(folder / "a.npz", flow=shift_flow(1, 0))


def bad_back(folder):
    (folder / "a.back.flo").write_bytes(b"PIEH")


def pickled(folder):
    np.savez(folder / "a.npz", flow_px=np.array([{}, None], dtype=object))


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (no_file, r"a\.flo: no such flow, nor as \.npz"),
        (two_files, r"a\.flo: there is a\.npz too"),
        (wrong_size, r"a\.npz: a flow of 55x40 pixels, .* 56x40"),
        (cut_file, r"a\.npz: not the \.npz"),
        (wrong_kind, r"a\.npz: .* instead of floating numbers"),
        (wrong_mask, r"a\.npz: valid is not bool"),
        (wrong_key, r"a\.npz: not the \.npz that it should be"),
        (pickled, r"a\.npz: not the \.npz that it should be"),
        (bad_back, r"a\.back\.flo: not a Middlebury"),
    ],
)
def test_bad_files_are_named(tmp_path, damage, reason):
    np.savez(tmp_path / "a.npz", flow_px=shift_flow(1, 0))
    damage(tmp_path)
    with pytest.raises(ValueError, match=reason):
        external.flow_and_validity(tmp_path, "a", SHAPE, tolerance_px=1.0)


@pytest.fixture
def scene(tmp_path):
    """Two photos; renders see them 2 px further right and 1 px up."""
    for seed, view in enumerate(("a", "b")):
        noise = np.random.default_rng(seed).normal(size=(50, 66, 3))
        large = cv2.GaussianBlur(noise, (0, 0), 1.5)
        large = np.clip(127 + 40 * large / large.std(), 0, 255).astype(np.uint8)
        images.write(tmp_path / "photos" / f"{view}.png", large[5:45, 5:61])
        images.write(tmp_path / "renders" / f"{view}.png", large[4:44, 7:63])
        write_flo(tmp_path / "flows" / f"{view}.flo", shift_flow(2, -1))
    return tmp_path


def run(scene, *more):
    return align.run(
        [
            *("--renders", str(scene / "renders"), "--photos", str(scene / "photos")),
            *("--flow-out", str(scene / "out" / "flow")),
            *("--warped-out", str(scene / "out" / "warped")),
            *("--stats-out", str(scene / "out" / "stats.csv")),
            *more,
        ]
    )


def test_align_takes_them_as_they_are(scene):
    flows = ("--method", "files", "--flows", str(scene / "flows"))
    assert run(scene, *flows) == 0
    with open(scene / "out" / "stats.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["view"] for row in rows] == ["a", "b"]
    for row in rows:
        assert float(row["median_px"]) == pytest.approx(5**0.5)
        assert float(row["blur_sigma_px"]) == 0
        flow_px, valid = files.read_flow(scene / "out" / "flow" / f"{row['view']}.npz")
        np.testing.assert_array_equal(flow_px, shift_flow(2, -1))
        render = images.read(scene / "renders" / f"{row['view']}.png")
        warped = images.read(scene / "out" / "warped" / f"{row['view']}.png")
        np.testing.assert_array_equal(warped[valid], render[valid])
        photo = images.read(scene / "photos" / f"{row['view']}.png")
        np.testing.assert_array_equal(warped, warp.warp(photo, flow_px))


def test_align_names_the_flow_that_is_missing_and_writes_nothing(scene, capsys):
    (scene / "flows" / "b.flo").unlink()
    assert run(scene, "--method", "files", "--flows", str(scene / "flows")) == 1
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("error: view b: ")
    assert "flows/b.flo: no such flow, nor as .npz" in error
    assert not list(scene.glob("out/**/*"))


def test_align_refuses_photos_of_another_size_by_name(scene, capsys):
    photo = images.read(scene / "photos" / "a.png")
    images.write(scene / "photos" / "a.png", photo[:-1])
    assert run(scene, "--method", "files", "--flows", str(scene / "flows")) == 1
    assert "view a: render and photo differ in size" in capsys.readouterr().err


@pytest.mark.parametrize("wrong", [("--method", "files"), ("--flows", "x")])
def test_method_and_folder_go_together(scene, wrong, capsys):
    assert run(scene, *wrong) == 1
    assert "--flows goes with --method files" in capsys.readouterr().err
