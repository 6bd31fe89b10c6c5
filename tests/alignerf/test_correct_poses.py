"""Cameras corrected by their flow: the stage `correct_poses`."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf import correct_poses
from alignerf.cameras import moves
from alignerf.io import faults
from alignerf.scenes import cameras, prepared
from flow.warping import files
from tests import camera_twins

WIDTH, HEIGHT, FOCAL_PX = 64, 48, 55.0
COUNT = 12
SPLIT = np.array(["test" if i % 6 == 0 else "train" for i in range(COUNT)])
NAMES = [f"v{i:02d}" for i in range(COUNT)]


def orbit():
    """Poses on a circle of radius 3 that look at the middle, in no normal frame."""
    poses = np.zeros((COUNT, 3, 4))
    for i in range(COUNT):
        turn = Rotation.from_euler("y", 2 * np.pi * i / COUNT).as_matrix()
        poses[i, :, :3] = turn
        poses[i, :, 3] = turn @ [0, 0.3 * np.sin(i), 3] + [10, -4, 2]
    return poses


def write_cameras(path, poses):
    pixtocams = np.stack([cameras.intrinsics(FOCAL_PX, WIDTH, HEIGHT)] * len(poses))
    arrays = {"pixtocams": pixtocams, "camtoworlds": poses}
    path.parent.mkdir(parents=True, exist_ok=True)
    sizes = {"width": WIDTH, "height": HEIGHT}
    np.savez(path, **arrays, **sizes, names=np.array(NAMES), split=SPLIT)


def wrong(poses, rng, px):
    """The poses, those of training views turned and shifted by some pixels."""
    found = poses.copy()
    for i in np.flatnonzero(SPLIT == "train"):
        turn = Rotation.from_rotvec(rng.normal(size=3) * px / FOCAL_PX / 1.5)
        found[i, :, :3] = poses[i, :, :3] @ turn.as_matrix()
        found[i, :, 3] += rng.normal(size=3) * px / FOCAL_PX
    return found


@pytest.fixture
def scene(tmp_path, rng):
    """A scene with wrong training poses, its truth, and the flow that tells."""
    true = orbit()
    given = wrong(true, rng, 2.0)
    write_cameras(tmp_path / "cameras.npz", given)
    write_cameras(tmp_path / "truth" / "cameras.npz", true)
    loaded = prepared.load(tmp_path)
    scale = cameras.frame_of(given).scale
    for kind in ("flow", "depth", "truth/depth"):
        (tmp_path / kind).mkdir()
    y = np.indices((HEIGHT, WIDTH))[0]
    depth = np.minimum(1 / np.maximum((y - 12) / 40, 0.05), 9.0)
    depth[20:40, 10:20] = 1.2
    for i in loaded.views("train"):
        camera, other = ((loaded.pixtocams[i], poses[i]) for poses in (given, true))
        flow_px = camera_twins.reprojection_flow(depth, camera, other)
        flow_px = flow_px.astype(np.float32)
        valid = np.ones((HEIGHT, WIDTH), bool)
        files.write_flow(tmp_path / "flow" / f"{NAMES[i]}.npz", flow_px, valid)
        # The renders' depth is in units of the normalised scene.
        np.savez(tmp_path / "depth" / f"{NAMES[i]}.npz", depth=scale * depth)
        np.savez(tmp_path / "truth" / "depth" / f"{NAMES[i]}.npz", depth_m=depth)
    return tmp_path


def run(scene, *more, cameras_path="cameras.npz"):
    """The stage; (its exit code, cameras written, report)."""
    out, report = scene / "new" / "cameras.npz", scene / "new" / "report.json"
    code = faults.exit_code(
        correct_poses.main,
        [
            *("--scene", str(scene), "--cameras", str(scene / cameras_path)),
            *("--flow", str(scene / "flow"), "--depth", str(scene / "depth")),
            *("--out", str(out), "--report", str(report), *more),
        ],
    )
    if not out.exists():
        return code, None, None
    return code, prepared.read_cameras(out), json.loads(report.read_text())


def test_wrong_cameras_come_back_to_the_truth(scene):
    code, found, report = run(scene, "--truth", str(scene / "truth"))
    assert code == 0
    error = report["pose_error_px"]
    assert error["given"] == error["before"] > 1
    assert error["after"] < 0.05 * error["given"]
    assert report["left_alone"] == report["only_turned"] == 0
    assert report["correction_px"] > 1
    given = prepared.read_cameras(scene / "cameras.npz")
    test = SPLIT == "test"
    for key in ("pixtocams", "camtoworlds"):
        np.testing.assert_array_equal(found[key][test], given[key][test])
    np.testing.assert_array_equal(found["pixtocams"], given["pixtocams"])
    # The frame has not moved against the given one.
    scale, turn, shift = moves.in_common(
        found["camtoworlds"][~test], given["camtoworlds"][~test]
    )
    assert scale == pytest.approx(1, abs=1e-5)
    np.testing.assert_allclose(turn, np.eye(3), atol=1e-5)
    np.testing.assert_allclose(shift, 0, atol=1e-5)


def test_without_depth_cameras_are_only_turned(scene, caplog):
    """As of another program's renders: what it cannot tell is said."""
    for path in (scene / "depth").glob("*.npz"):
        np.savez(path, depth=np.full((HEIGHT, WIDTH), np.inf, np.float32))
    code, found, report = run(scene, "--truth", str(scene / "truth"))
    assert code == 0
    count = int((SPLIT == "train").sum())
    assert report["only_turned"] == count - report["left_alone"] > 0
    assert f"of {count} cameras got a turn and a zoom only" in caplog.text
    assert np.isfinite(found["camtoworlds"]).all()
    error = report["pose_error_px"]
    assert error["after"] < error["given"]


def test_the_report_says_what_was_done_to_each_view(scene):
    _, found, report = run(scene)
    assert "pose_error_px" not in report
    given = prepared.read_cameras(scene / "cameras.npz")
    scale = cameras.frame_of(given["camtoworlds"]).scale
    train = np.flatnonzero(SPLIT == "train")
    assert [row["view"] for row in report["of_views"]] == [NAMES[i] for i in train]
    for i, row in zip(train, report["of_views"], strict=True):
        old, new = (poses["camtoworlds"][i] for poses in (given, found))
        turn = Rotation.from_matrix(old[:, :3].T @ new[:, :3]).magnitude()
        assert row["rotation_deg"] == pytest.approx(np.degrees(turn), rel=1e-5)
        step = scale * np.linalg.norm(new[:, 3] - old[:, 3])
        assert row["centre"] == pytest.approx(step, rel=1e-5)
        assert 0 < row["length_px"] < 20
        assert (row["valid_fraction"], row["left_alone"]) == (1.0, "")


def test_a_view_left_alone_does_not_move_at_all(scene, caplog):
    name = NAMES[3]
    flow_px, valid = files.read_flow(scene / "flow" / f"{name}.npz")
    files.write_flow(scene / "flow" / f"{name}.npz", flow_px, valid & False)
    code, found, report = run(scene)
    assert code == 0
    given = prepared.read_cameras(scene / "cameras.npz")["camtoworlds"]
    np.testing.assert_array_equal(found["camtoworlds"][3], given[3])
    assert np.all((found["camtoworlds"] != given).any(axis=(1, 2))[[1, 2, 4, 5]])
    assert report["left_alone"] == 1
    (row,) = [row for row in report["of_views"] if row["left_alone"]]
    assert row["view"] == name
    assert f"view {name} stays: only 0 pixels have a flow" in caplog.text
    assert row["left_alone"] == "only 0 pixels have a flow and a depth"
    assert row["rotation_deg"] == 0
    assert row["length_px"] == pytest.approx(0, abs=1e-9)


def test_a_lens_that_is_put_right_is_every_views(scene):
    """Of views left alone and of test views too; their poses stay."""
    zoom, left = 1.02, NAMES[3]
    loaded = prepared.load(scene)
    y, x = np.indices((HEIGHT, WIDTH)) + 0.5
    for i in loaded.views("train"):
        path = scene / "flow" / f"{NAMES[i]}.npz"
        away = np.stack([x - WIDTH / 2, y - HEIGHT / 2], axis=-1)
        flow_px = ((zoom - 1) * away).astype(np.float32)
        files.write_flow(path, flow_px, np.full((HEIGHT, WIDTH), NAMES[i] != left))
    _, found, report = run(scene)
    given = prepared.read_cameras(scene / "cameras.npz")
    assert report["focal_ratio"] == pytest.approx(zoom, rel=1e-3)
    focal = 1 / found["pixtocams"][:, 0, 0]
    np.testing.assert_allclose(focal, zoom * FOCAL_PX, rtol=1e-3)
    stay = [*np.flatnonzero(SPLIT == "test"), NAMES.index(left)]
    np.testing.assert_array_equal(
        found["camtoworlds"][stay], given["camtoworlds"][stay]
    )


def test_other_cameras_come_in_the_frame_of_the_scenes_own(scene, rng):
    own = prepared.load(scene)
    other = wrong(prepared.read_cameras(scene / "cameras.npz")["camtoworlds"], rng, 40)
    write_cameras(scene / "other.npz", other)
    loaded = prepared.load(scene, scene / "other.npz")
    test = SPLIT == "test"
    np.testing.assert_array_equal(loaded.camtoworlds[test], own.camtoworlds[test])
    # By its own frame it would be elsewhere.
    by_its_own = cameras.frame_of(other).normalised(other)
    assert np.abs(by_its_own - loaded.camtoworlds).max() > 0.01
    same = prepared.load(scene, scene / "cameras.npz")
    np.testing.assert_array_equal(same.camtoworlds, own.camtoworlds)


def test_rounds_build_on_the_cameras_before(scene):
    """A second round without any flow left leaves the first one's cameras."""
    _, first, _ = run(scene)
    (scene / "new" / "cameras.npz").rename(scene / "first.npz")
    for path in (scene / "flow").iterdir():
        flow_px, valid = files.read_flow(path)
        files.write_flow(path, 0 * flow_px, valid)
    _, second, report = run(scene, cameras_path="first.npz")
    np.testing.assert_allclose(second["camtoworlds"], first["camtoworlds"], atol=1e-7)
    assert report["correction_px"] < 1e-6
    # Against the given cameras, all that was done counts.
    assert all(row["length_px"] > 0.01 for row in report["of_views"])


def test_a_view_that_moves_alone_keeps_its_motion(scene):
    """The others stay, and hold the frame; in a round without flow nothing moves."""
    bent, still = NAMES[3], scene / "flow"
    for path in still.iterdir():
        flow_px, valid = files.read_flow(path)
        if path.stem != bent:
            files.write_flow(path, flow_px, valid & False)
    _, first, report = run(scene)
    (row,) = [row for row in report["of_views"] if not row["left_alone"]]
    assert row["view"] == bent
    assert report["correction_px"] == row["this_round_px"] > 1
    # What all corrections share is taken out, and one of many shares little.
    assert row["length_px"] > 0.5 * row["this_round_px"]
    (scene / "new" / "cameras.npz").rename(scene / "first.npz")
    flow_px, valid = files.read_flow(still / f"{bent}.npz")
    files.write_flow(still / f"{bent}.npz", 0 * flow_px, valid)
    _, second, _ = run(scene, cameras_path="first.npz")
    np.testing.assert_allclose(second["camtoworlds"], first["camtoworlds"], atol=1e-9)


@pytest.mark.parametrize(
    ("break_it", "reason"),
    [
        (lambda f: (f / "flow" / "v03.npz").unlink(), "flow/v03.npz"),
        (lambda f: (f / "depth" / "v03.npz").write_bytes(b"PK"), "depth/v03.npz"),
        (
            lambda f: np.savez(f / "depth" / "v03.npz", depth=np.ones((4, 4))),
            "depth/v03.npz: (4, 4), not (48, 64) px",
        ),
        (
            lambda f: np.savez(
                f / "flow" / "v03.npz",
                flow_px=np.full((HEIGHT, WIDTH, 2), np.nan, np.float32),
                valid=np.ones((HEIGHT, WIDTH), bool),
            ),
            "flow/v03.npz",
        ),
    ],
)
def test_bad_files_are_named(scene, capsys, break_it, reason):
    break_it(scene)
    code, found, _ = run(scene)
    assert code == 1
    assert found is None
    error = capsys.readouterr().err
    assert reason in error
    assert error.count("\n") == 1
    assert not (scene / "new").exists() or not any((scene / "new").iterdir())


def test_cameras_of_other_views_are_refused(scene, capsys):
    write_cameras(scene / "other.npz", orbit())
    arrays = dict(np.load(scene / "other.npz"))
    arrays["names"] = arrays["names"][::-1]
    np.savez(scene / "other.npz", **arrays)
    assert run(scene, cameras_path="other.npz")[0] == 1
    assert "other.npz: names differ from those of" in capsys.readouterr().err
