"""Frames of a film: of what cameras, at what size, and again after a kill."""

import json
import types

import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.experiment.tables import json_rows, sides
from alignerf.files import faults, images, machine
from alignerf.flythrough import __main__ as command
from alignerf.flythrough import nerfstudio, rendering
from alignerf.scenes import cameras, prepared
from alignerf.training import methods, renderer
from tests import job_cases
from tests.alignerf.flythrough import captures, test_film

SIZE = 32, 24


class Killed(BaseException):
    """A process that ends in the middle, as far as files can tell."""


def painted(tint):
    """A method that shows where rays go, and a tint: nothing is trained."""

    def render(params, rays):
        values = 0.4 + 0.3 * rays.viewdirs + tint
        return types.SimpleNamespace(values=values, depth=jnp.ones(len(values)))

    return methods.Method(1, None, None, None, render, lambda params, v: v, 0)


@pytest.fixture
def scene(tmp_path):
    return job_cases.make_scene(tmp_path)


@pytest.fixture
def made(scene, monkeypatch):
    """A folder with a path of 8 frames and files of two sides; models are painted."""

    def read_model(job, model, loaded):
        return painted(json.loads(job)["tint"]), {}

    monkeypatch.setattr(renderer, "read_model", read_model)
    monkeypatch.setattr(rendering, "LEAST_SIDE_PX", 8)
    there = captures.ring(5, share=0.1)
    path = nerfstudio.CameraPath(
        np.concatenate([there, there[1:-1][::-1]]), np.full(8, 40.0), 320, 240, 24.0
    )
    (scene / "camera_path.json").write_text(json.dumps(nerfstudio.content(path)))
    for name in "ab":
        (scene / f"{name}.msgpack").write_bytes(name.encode())
    (scene / "test.json").write_text(json.dumps({"view_time_s": 0.5, "views": 2}))
    return scene


def sides_of(folder, tints=(0.0, 0.2)):
    """Two sides of the files that `made` has written."""
    return [
        sides.Side(
            label,
            json.dumps({"tint": tint}),
            str(folder / f"{name}.msgpack"),
            str(folder / "cameras.npz"),
            str(folder / "test.json"),
            1,
        )
        for name, label, tint in zip("ab", ("before", "after"), tints, strict=True)
    ]


def run(folder, every=None):
    command.main(
        [
            *(
                "--scene",
                str(folder),
                "--camera-path",
                str(folder / "camera_path.json"),
            ),
            *("--sides", json_rows.as_json(every or sides_of(folder))),
            *("--frames", str(folder / "frames")),
            *("--out", str(folder / "flythrough.webm")),
        ]
    )
    return test_film.read(folder / "flythrough.webm")[1]


@pytest.fixture
def rendered(monkeypatch):
    """Counts the frames that are rendered; a number stops it, as a kill does."""
    written, write = [], images.write

    def count(path, image):
        if count.most is not None and len(written) >= count.most:
            raise Killed
        written.append(path)
        write(path, image)

    count.most, count.written = None, written
    monkeypatch.setattr(images, "write", count)
    return count


def test_a_film_shows_both_sides_there_and_back(made, rendered):
    film = run(made)
    assert len(film) == 8
    # Five places of each side; the way back is not rendered again.
    assert len(rendered.written) == 2 * 5
    middle = film.shape[2] // 2
    left, right = film[:, 60:, : middle - 9], film[:, 60:, middle + 9 :]
    tints = right.mean(axis=(1, 2, 3)) - left.mean(axis=(1, 2, 3))
    np.testing.assert_allclose(tints, 0.2 * 255, atol=5)
    back = np.abs(left[1:4].astype(float) - left[7:4:-1]).mean()
    other = np.abs(left[1:4].astype(float) - left[2:5]).mean()
    assert back < 0.5 * other
    assert {"frames"}.isdisjoint(path.name for path in made.iterdir())


def test_a_killed_film_goes_on_from_its_frames(made, rendered, caplog):
    whole = run(made)
    rendered.written.clear()
    rendered.most = 4
    (made / "flythrough.webm").unlink()
    with pytest.raises(Killed):
        run(made)
    assert not (made / "flythrough.webm").exists()
    assert len([*(made / "frames").glob("*/*.png")]) == 4
    rendered.most = None
    rendered.written.clear()
    with caplog.at_level("INFO", logger="alignerf"):
        again = run(made)
    assert "4 of 10 frames are there: going on" in caplog.text
    assert len(rendered.written) == 6
    np.testing.assert_array_equal(again, whole)


def test_a_damaged_frame_is_rendered_again(made, rendered):
    rendered.most = 6
    with pytest.raises(Killed):
        run(made)
    rendered.most = None
    damaged = sorted((made / "frames").glob("*/*.png"))[0]
    whole = damaged.read_bytes()
    damaged.write_bytes(whole[: len(whole) // 2])
    rendered.written.clear()
    run(made)
    assert len(rendered.written) == 5


@pytest.mark.parametrize("what", ["model", "path", "job", "cameras"])
def test_frames_of_anything_else_are_not_shown(made, rendered, what):
    rendered.most = 6
    with pytest.raises(Killed):
        run(made)
    rendered.most, every = None, sides_of(made)
    if what == "model":
        (made / "b.msgpack").write_bytes(b"another")
    elif what == "path":
        content = json.loads((made / "camera_path.json").read_text())
        content["camera_path"][3]["camera_to_world"][3] += 0.1
        (made / "camera_path.json").write_text(json.dumps(content))
    elif what == "job":
        every = sides_of(made, (0.1, 0.2))
    else:
        arrays = dict(np.load(made / "cameras.npz"))
        arrays["camtoworlds"][1, 0, 3] += 0.1
        np.savez(made / "cameras.npz", **arrays)
    rendered.written.clear()
    run(made, every)
    # Of the changed path one place is new, and the way back another than the way there.
    assert len(rendered.written) == (12 if what == "path" else 10)


def test_sides_are_read_or_refused_by_name(made, capsys):
    words = ["--scene", str(made), "--camera-path", str(made / "camera_path.json")]
    words += ["--frames", str(made / "frames"), "--out", str(made / "film.webm")]
    for text, said in (("[]", "--sides: no row"), ("[{}]", "--sides[0].label: ")):
        assert faults.exit_code(command.main, [*words, "--sides", text]) == 1
        assert capsys.readouterr().err.startswith(f"error: {said}")
    (made / "test.json").write_text('{"view_time_s": -1}')
    text = json_rows.as_json(sides_of(made))
    assert faults.exit_code(command.main, [*words, "--sides", text]) == 1
    assert "test.json: view_time_s is -1" in capsys.readouterr().err
    assert not (made / "film.webm").exists()


def test_frames_that_are_equal_are_one(made):
    path = nerfstudio.read(made / "camera_path.json")
    poses, of_frame = rendering.frames(path)
    assert of_frame.tolist() == [0, 1, 2, 3, 4, 3, 2, 1]
    np.testing.assert_array_equal(poses[of_frame], path.poses)


@pytest.mark.parametrize("view_s", [0.0, 1e-3, 0.3, 3.0, 1e4])
@pytest.mark.parametrize("count", [1, 61, 120])
@pytest.mark.parametrize("cores", [1, 2, 16])
def test_the_size_is_such_that_two_minutes_are_enough(
    made, monkeypatch, view_s, count, cores
):
    monkeypatch.setattr(machine, "cores", lambda: cores)
    (made / "test.json").write_text(json.dumps({"view_time_s": view_s}))
    loaded = prepared.load(made)
    path = nerfstudio.read(made / "camera_path.json")
    size = rendering.size_of(loaded, path, sides_of(made), count)
    assert size <= (loaded.width, loaded.height)
    share = size[0] * size[1] / (loaded.width * loaded.height)
    takes_s = 2 * count * view_s / cores * share
    assert takes_s <= rendering.BUDGET_S or min(size) == 8
    if takes_s and size < (loaded.width, loaded.height) and min(size) > 8:
        # And not much smaller than that.
        assert takes_s > 0.7 * rendering.BUDGET_S


def test_cameras_that_have_all_moved_alike_take_the_path_along(made):
    """Such a gauge is in the model, too: it sees the same from the path."""
    loaded = prepared.load(made)
    path = nerfstudio.read(made / "camera_path.json")
    arrays = dict(np.load(made / "cameras.npz"))
    turn, shift = captures.ring(7)[3, :, :3], np.array([0.3, -0.2, 0.1])
    moved = cameras.apply_similarity(arrays["camtoworlds"], 1.1, turn, shift)
    longer = np.linalg.inv(arrays["pixtocams"]) * [[[1.25], [1.25], [1]]]
    arrays |= {"camtoworlds": moved, "pixtocams": np.linalg.inv(longer)}
    np.savez(made / "learnt.npz", **arrays)
    before, after = sides_of(made)
    after = after._replace(cameras=str(made / "learnt.npz"))
    seen = [
        rendering.views_of(loaded, path, path.poses, side, SIZE)
        for side in (before, after)
    ]
    frame = cameras.frame_of(prepared.read_cameras(made / "cameras.npz")["camtoworlds"])
    np.testing.assert_allclose(frame.given(seen[0].poses), path.poses, atol=1e-9)
    expected = cameras.apply_similarity(path.poses, 1.1, turn, shift)
    np.testing.assert_allclose(frame.given(seen[1].poses), expected, atol=1e-9)
    # A longer lens of all cameras is one of the path, too.
    focal_px = [1 / one.pixtocam[0, 0] for one in seen]
    assert focal_px[0] == pytest.approx(nerfstudio.focal_px(40.0, SIZE[1]))
    assert focal_px[1] / focal_px[0] == pytest.approx(1.25)
