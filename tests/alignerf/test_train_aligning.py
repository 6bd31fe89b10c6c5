"""A training that aligns itself and learns its cameras: its outputs, and resuming."""

import json

import cv2
import jax
import numpy as np
import pytest
from PIL import Image

from alignerf.alignment import look, store
from alignerf.methods import auto
from alignerf.methods.align import Align
from alignerf.methods.pose_optimization import PoseOptimization
from alignerf.scenes import cameras, prepared
from alignerf.training import loop, memory
from tests import job_cases as cases

# The flow needs 32 px a side: renders are half as large, and a row and a column over.
WIDTH, HEIGHT, COUNT = 81, 67, 6
# All that a flow finds is taken: renders of so short a training are no match.
ALIGN = {
    "cameras_at": [0.3, 0.6],
    "photos_at": [0.6],
    "shrink": 3,
    "min_move_px": 0.0,
    "estimator": "dis_medium",
}
LOOKS = Align(**ALIGN | {"cameras_at": [0.3], "photos_at": [0.6]})
LEARNT = PoseOptimization(delay_fraction=0.3, end_fraction=0.75)
JOB = cases.JOB | {"auto": True}
# Of 14 steps.
FIRST, SECOND, LAST = 4, 8, 10


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Photos of one smooth picture, each shifted by some pixels."""
    folder = tmp_path_factory.mktemp("scene")
    (folder / "images").mkdir()
    rng = np.random.default_rng(0)
    noise = rng.uniform(size=(HEIGHT + 16, WIDTH + 16, 3)).astype(np.float32)
    wide = cv2.GaussianBlur(noise, (0, 0), 4.0)
    wide = (255 * (wide - wide.min()) / np.ptp(wide)).astype(np.uint8)
    names = [f"v{i}" for i in range(COUNT)]
    for i, name in enumerate(names):
        photo = wide[8 + i : 8 + i + HEIGHT, 10 - i : 10 - i + WIDTH]
        Image.fromarray(photo).save(folder / "images" / f"{name}.png")
    poses = np.repeat(np.eye(4)[None, :3], COUNT, axis=0)
    poses[:, :2, 3] = 0.05 * rng.normal(size=(COUNT, 2))
    np.savez(
        folder / "cameras.npz",
        pixtocams=np.stack([cameras.intrinsics(50.0, WIDTH, HEIGHT)] * COUNT),
        camtoworlds=poses,
        names=names,
        width=WIDTH,
        height=HEIGHT,
        split=["test", *["train"] * (COUNT - 1)],
    )
    return folder


def run(scene, out, job=JOB, *more):
    """(model's bytes, bytes of all that is written of cameras and photos)."""
    learnt = out / "learnt"
    model = cases.run(scene, out, job, *more)
    arrays = prepared.read_cameras(learnt / "cameras.npz")
    found = [arrays[key].tobytes() for key in ("pixtocams", "camtoworlds")]
    for path in sorted(learnt.glob("photos/*.png")):
        found.append(np.asarray(Image.open(path)).tobytes())
    for path in sorted(learnt.glob("valid/*.npz")):
        found.append(np.load(path)["valid"].tobytes())
    assert len(found) == 2 + 2 * (COUNT - 1)
    return model, found


@pytest.fixture(scope="module", autouse=True)
def settings():
    """Of `auto`: with photos that are warped while cameras are learnt."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(auto.Job, "aligns", LOOKS)
        patched.setattr(auto.Job, "learns", LEARNT)
        yield


@pytest.fixture(scope="module", autouse=True)
def clear_flow():
    """A flow that hangs on every bit of a render, and that a camera explains in part.

    What so short a training shows has no flow that could be trusted.
    """

    def flow_of(render, photo, **options):
        differ = photo.mean(dtype=float) - render.mean(dtype=float)
        shift_px = [differ / 100 + 0.5, render.std(dtype=float) / 50 - 0.4]
        flow_px = np.tile(np.float32(shift_px), (*render.shape[:2], 1))
        flow_px[8:20, 10:24] += [1.5, render[12, 12, 0] / 200]
        return flow_px, np.ones(render.shape[:2], bool)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(look, "flow_of", flow_of)
        yield


@pytest.fixture(scope="module")
def whole(scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("whole")
    return out, run(scene, out)


def test_it_says_what_it_saw_and_did(scene, whole):
    out, _ = whole
    timing = json.loads((out / "timing.json").read_text())
    assert [row["step"] for row in timing["alignments"]] == [FIRST, SECOND, LAST]
    assert [row["corrects"] for row in timing["alignments"]] == [
        ["cameras", "learn"],
        ["photos"],
        ["hold"],
    ]
    first, second, last = timing["alignments"]
    assert first["learning"]
    assert last["learning"] is False
    assert first["flow_px"] > 0
    assert first["cameras_moved"] + sum(map(len, first["left_alone"].values())) == 5
    # Something was done, or the tests of resuming would show nothing.
    assert second["photos_warped"] == COUNT - 1
    for row in timing["alignments"]:
        assert row["shrink"] == 2
        assert 0 < row["time_s"] < timing["train_time_s"]
    given = prepared.read_cameras(scene / "cameras.npz")
    moved = prepared.read_cameras(out / "learnt/cameras.npz")
    learnt = cases.params_of(out)["cameras"]
    assert (learnt != 0).all()
    assert (moved["camtoworlds"] != given["camtoworlds"]).any()


def test_alignment_alone_is_another_training(scene, whole, tmp_path):
    """It learns no camera, and so moves no held-out one."""
    assert run(scene, tmp_path, cases.JOB | {"align": ALIGN}) != whole[1]
    assert "cameras" not in cases.params_of(tmp_path)
    given = prepared.read_cameras(scene / "cameras.npz")
    moved = prepared.read_cameras(tmp_path / "learnt/cameras.npz")
    assert (moved["camtoworlds"] != given["camtoworlds"]).any()
    np.testing.assert_array_equal(moved["camtoworlds"][0], given["camtoworlds"][0])


@pytest.mark.parametrize(
    "own",
    cases.one_of(
        [{"auto": True}, {"pose_optimization": {"delay_fraction": 0.3}}], {"auto": True}
    ),
)
def test_where_the_flow_says_that_nothing_is_wrong_it_is_plain(
    scene, tmp_path, monkeypatch, own
):
    """To the bit: no camera is learnt, and the steps are those of plain training."""

    def still(render, photo, **options):
        shape = render.shape[:2]
        return np.zeros((*shape, 2), np.float32), np.ones(shape, bool)

    monkeypatch.setattr(look, "flow_of", still)
    monkeypatch.setattr(auto.Job, "aligns", auto.ALIGNS)
    monkeypatch.setattr(auto.Job, "learns", auto.LEARNS)
    outs = [tmp_path / name for name in ("own", "plain")]
    for out, job in zip(outs, (own, {}), strict=True):
        cases.run(scene, out, cases.JOB | job)
    timing = json.loads((outs[0] / "timing.json").read_text())
    assert not any(row.get("learning") for row in timing["alignments"])
    found, plain = map(cases.params_of, outs)
    assert not found.pop("cameras").any()
    jax.tree.map(np.testing.assert_array_equal, found, plain)
    given = prepared.read_cameras(scene / "cameras.npz")
    moved = prepared.read_cameras(outs[0] / "learnt/cameras.npz")
    np.testing.assert_array_equal(moved["camtoworlds"], given["camtoworlds"])


def killed(monkeypatch, scene, out, patch):
    """A training that a patch ends."""
    with monkeypatch.context() as patched:
        patch(patched)
        with pytest.raises(cases.Killed):
            run(scene, out)
    assert not (out / "learnt" / "model.msgpack").exists()
    assert not (out / "learnt").exists()


@pytest.mark.parametrize(
    "at_step", cases.one_of([2, FIRST, 6, SECOND, LAST, 12], FIRST, LAST)
)
def test_killed_before_or_after_it_resumes_bit_for_bit(
    scene, whole, tmp_path, monkeypatch, at_step, caplog
):
    monkeypatch.setattr(loop, "FETCH_EVERY", 2)
    killed(monkeypatch, scene, tmp_path, lambda p: cases.kill_after_save(p, at_step, 2))
    if at_step == 2:
        jax.clear_caches()
    caplog.set_level("INFO", "alignerf")
    assert run(scene, tmp_path) == whole[1]
    assert f"resuming at step {at_step} of" in caplog.text


@pytest.mark.parametrize("when", ["before it is written", "after"])
@pytest.mark.parametrize("which", cases.one_of([0, 1, 2], 1))
def test_killed_within_it_resumes_bit_for_bit(
    scene, whole, tmp_path, monkeypatch, when, which
):
    """Before its file is there, and when the file is, and its step is not made."""
    count = []

    def patch(patched):
        write = store.write

        def dies(*arguments, **options):
            count.append(1)
            last = len(count) == which + 1
            if not last or when == "after":
                write(*arguments, **options)
            if last:
                raise cases.Killed

        patched.setattr(store, "write", dies)

    killed(monkeypatch, scene, tmp_path, patch)
    looked = []
    look_at = look.Looker.__call__

    def noted(self, *arguments):
        looked.append(1)
        return look_at(self, *arguments)

    monkeypatch.setattr(look.Looker, "__call__", noted)
    assert run(scene, tmp_path) == whole[1]
    # What is on disk is not looked for again.
    assert len(looked) == max(2 - which - (when == "after"), 0)


def test_a_lost_alignment_starts_anew(scene, whole, tmp_path, monkeypatch, caplog):
    killed(monkeypatch, scene, tmp_path, lambda p: cases.kill_after_save(p, 10, 2))
    (tmp_path / "checkpoints/alignment.json").unlink()
    assert run(scene, tmp_path) == whole[1]
    assert "its alignment is lost, starting anew" in caplog.text


def test_a_finished_one_that_is_run_again_tells_the_same(scene, tmp_path):
    found = []
    for _ in range(2):
        result = run(scene, tmp_path)
        timing = json.loads((tmp_path / "timing.json").read_text())
        found.append((result, timing["alignments"]))
    assert found[0] == found[1]


def test_a_step_is_compiled_before_and_after_cameras_are_learnt(
    scene, tmp_path, monkeypatch
):
    compiled = []
    compile_to_fit = memory.compile_to_fit

    def note(*arguments, **options):
        compiled.append(1)
        return compile_to_fit(*arguments, **options)

    monkeypatch.setattr(memory, "compile_to_fit", note)
    run(scene, tmp_path)
    assert len(compiled) == 2


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"cameras_at": [0.3, 0.31]}, "align.cameras_at: 0.31 of 14 steps is number 4"),
        ({"photos_at": [0.01]}, "align.photos_at: 0.01 of 14 steps is the first"),
        ({"photos_at": [0.99]}, "0.99 of 14 steps is beyond the last"),
        ({"cameras_at": [1.5]}, "config: align.cameras_at.0: 1.5 should be less"),
    ],
)
def test_what_cannot_be_is_one_line(scene, tmp_path, capsys, change, fault):
    job = cases.JOB | {"align": ALIGN | change}
    line = cases.stops(capsys, lambda: run(scene, tmp_path, job))
    assert fault in line
    assert not (tmp_path / "learnt" / "model.msgpack").exists()


def test_photos_that_are_not_warped_are_not_written(scene, tmp_path):
    job = cases.JOB | {"align": ALIGN | {"cameras_at": [0.3], "photos_at": []}}
    cases.run(scene, tmp_path, job)
    written = {path.name for path in (tmp_path / "learnt").glob("[!.]*")}
    assert written == {"cameras.npz", "model.msgpack"}
