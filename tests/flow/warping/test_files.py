"""flow.warping.files, flow.warping.files and flow.figures.drawing."""

import os

import numpy as np
import pytest

from flow.figures import drawing
from flow.warping import files


def random_flow(seed=0, height=11, width=17):
    rng = np.random.default_rng(seed)
    flow_px = rng.normal(size=(height, width, 2)).astype(np.float32)
    return flow_px, rng.random((height, width)) < 0.7


def flo_bytes(flow_px):
    height, width = flow_px.shape[:2]
    header = b"PIEH" + np.array([width, height], "<i4").tobytes()
    return header + flow_px.astype("<f4").tobytes()


def test_flow_round_trip(tmp_path):
    for seed in range(5):
        flow_px, valid = random_flow(seed)
        files.write_flow(tmp_path / "a.npz", flow_px, valid)
        flow_back, valid_back = files.read_flow(tmp_path / "a.npz")
        np.testing.assert_array_equal(flow_back, flow_px)
        np.testing.assert_array_equal(valid_back, valid)
        assert flow_back.dtype == np.float32
    assert os.listdir(tmp_path) == ["a.npz"]


def test_flow_files_cut_or_altered_anywhere_are_refused_by_name(tmp_path):
    path = tmp_path / "a.npz"
    flow_px, valid = random_flow()
    files.write_flow(path, flow_px, valid)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for cut in [0, 1, 4, 30, *rng.integers(0, len(whole) - 1, 40)]:
        path.write_bytes(whole[:cut])
        with pytest.raises(ValueError, match=r"a\.npz"):
            files.read_flow(path)
    for at in rng.integers(0, len(whole), 200):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        # Bytes that no reader looks at (dates, attributes) may change freely.
        try:
            flow_back, valid_back = files.read_flow(path)
        except ValueError as error:
            message = str(error)
        else:
            message = "a.npz"
            np.testing.assert_array_equal(flow_back, flow_px)
            np.testing.assert_array_equal(valid_back, valid)
        assert "a.npz" in message


def test_flow_files_of_other_content_are_refused_by_name(tmp_path):
    path = tmp_path / "a.npz"
    flow_px, valid = random_flow()
    contents = [
        {"flow_px": flow_px},
        {"flow_px": flow_px, "valid": valid[1:]},
        {"flow_px": flow_px, "valid": valid.astype(int)},
        {"flow_px": flow_px.astype(float), "valid": valid},
        {"flow_px": flow_px[..., :1], "valid": valid},
        {"flow_px": flow_px * np.float32(np.nan), "valid": valid},
        {"flow_px": np.array([{}], dtype=object), "valid": valid},
    ]
    for content in contents:
        np.savez(path, **content)
        with pytest.raises(ValueError, match=r"a\.npz"):
            files.read_flow(path)
    with open(path, "wb") as file:
        np.save(file, flow_px)
    with pytest.raises(ValueError, match=r"a\.npz"):
        files.read_flow(path)
    with pytest.raises(ValueError, match="not finite"):
        files.write_flow(tmp_path / "b.npz", flow_px * np.inf, valid)
    assert not (tmp_path / "b.npz").exists()
    with pytest.raises(ValueError, match=r"none\.npz: not found"):
        files.read_flow(tmp_path / "none.npz")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ({"names": ["a"], "split": ["test"]}, "no view in split 'train'"),
        ({"names": ["a"]}, "split"),
    ],
)
def test_cameras_without_a_split_are_named(tmp_path, content, reason):
    path = tmp_path / "cameras.npz"
    np.savez(path, **{"k": np.zeros(len(content["names"]))} | content)
    with pytest.raises(ValueError, match=rf"cameras\.npz: .*{reason}"):
        files.read_split(path, "train", "k")


def test_a_split_is_in_the_order_of_names(tmp_path):
    path = tmp_path / "cameras.npz"
    split = ["train", "test", "train"]
    np.savez(path, names=["d", "b c", "a"], split=split, k=[1, 2, 3])
    assert files.read_split(path, "train", "k") == {"a": [3], "d": [1]}


def test_flo(tmp_path):
    flow_px, _ = random_flow()
    flow_px[3, 4] = 2e9
    flow_px[5, 6, 1] = np.nan
    path = tmp_path / "a.flo"
    whole = flo_bytes(flow_px)
    path.write_bytes(whole)
    read_px, valid = files.read_flo(path)
    assert valid.sum() == valid.size - 2
    assert not valid[3, 4]
    assert not valid[5, 6]
    np.testing.assert_array_equal(read_px[valid], flow_px[valid])
    np.testing.assert_array_equal(read_px[~valid], 0)
    negative = b"PIEH" + np.array([-17, -11], "<i4").tobytes() + whole[12:]
    cut = [b"", whole[:11], whole[:-1]]
    for bad in (*cut, whole + b"0", b"HEIP" + whole[4:], negative):
        path.write_bytes(bad)
        with pytest.raises(ValueError, match=r"a\.flo: not a Middlebury"):
            files.read_flo(path)


def test_statistics_count_valid_pixels_only():
    rng = np.random.default_rng(0)
    for _ in range(20):
        valid = rng.random((30, 40)) < 0.5
        angle, length = rng.uniform(0, 2 * np.pi, (30, 40)), rng.gamma(2, size=(30, 40))
        flow_px = length[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        flow_px[~valid] = 1e6
        found = files.statistics(flow_px, valid, view="a")
        assert found["mean_px"] == pytest.approx(length[valid].mean())
        assert found["median_px"] == pytest.approx(np.median(length[valid]))
        assert (length[valid] <= found["p95_px"]).mean() == pytest.approx(
            0.95, abs=0.01
        )
        assert found["valid_fraction"] == pytest.approx(valid.mean())


def test_statistics_of_nothing_are_empty_and_a_mask_of_another_size_is_named():
    flow_px = np.zeros((4, 5, 2), np.float32)
    found = files.statistics(flow_px, np.zeros((4, 5), bool), view="left_3")
    assert found == dict.fromkeys(files.LENGTHS, "") | {"valid_fraction": 0}
    with pytest.raises(ValueError, match="view left_3"):
        files.statistics(flow_px, np.ones((4, 4), bool), view="left_3")


def test_no_flow_is_white_and_saturation_grows_with_length():
    angle = np.linspace(0, 2 * np.pi, 73)
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[None]
    saturation = []
    for length in np.linspace(0, 0.999, 9):
        colour = drawing.encode(3 * length * unit, scale_px=3).astype(float)
        saturation.append(colour.max(axis=-1) - colour.min(axis=-1))
    assert (np.array(saturation[0]) == 0).all()
    assert (np.diff(saturation, axis=0) > 0).all()
    white = drawing.encode(np.zeros((2, 2, 2)), scale_px=1)
    assert (white == 255).all()


def test_scale_is_a_unit():
    flow_px, _ = random_flow()
    for factor in (0.1, 2.0, 1e6):
        np.testing.assert_allclose(
            drawing.encode(factor * flow_px.astype(float), scale_px=2 * factor),
            drawing.encode(flow_px, scale_px=2),
            atol=1,
        )


def test_opposite_directions_differ_and_the_wheel_closes():
    angle = np.linspace(0, 2 * np.pi, 361)
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[None]
    colour = drawing.encode(unit, scale_px=1.0001)[0].astype(int)
    assert np.abs(np.diff(colour, axis=0)).max() < 50
    assert np.abs(colour[:180] - colour[180:360]).sum(axis=-1).min() > 150
    # Published code: right is red, down yellow, left cyan to blue.
    assert colour[0].argmax() == 0
    assert colour[90].argmin() == 2
    assert colour[180].argmin() == 0


def test_invalid_is_black_and_bad_scales_are_refused():
    flow_px, valid = random_flow()
    flow_px[0, 0], valid[0, 0] = np.nan, True
    colour = drawing.encode(flow_px, scale_px=1, valid=valid)
    assert (colour[~valid] == 0).all()
    assert (colour[0, 0] == 0).all()
    assert colour[valid][1:].any(axis=-1).all()
    for scale_px in (0, -1, np.nan, np.inf):
        with pytest.raises(ValueError, match="scale_px"):
            drawing.encode(flow_px, scale_px=scale_px)


@pytest.mark.parametrize("side_px", [1, 2, 31, 100])
def test_legend_shows_the_code_of_its_own_offsets(side_px):
    wheel = drawing.legend(side_px)
    assert wheel.shape == (side_px, side_px, 3)
    if side_px > 2:
        assert (wheel[0, 0] == 255).all()
        middle, quarter = side_px // 2, side_px // 4
        right = np.array([[[quarter, 0.0]]])
        expected = drawing.encode(right, scale_px=side_px / 2)[0, 0].astype(int)
        found = wheel[middle, middle + quarter].astype(int)
        assert np.abs(found - expected).max() < 40
