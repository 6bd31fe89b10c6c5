"""COLMAP's files are walked before its own reader, which believes anything."""

import os

import pycolmap
import pytest

from alignerf.scenes.formats import colmap_models

FILES = [f"{name}.bin" for name in colmap_models.FILES]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("model")
    options = pycolmap.SyntheticDatasetOptions()
    options.num_frames_per_rig = 4
    options.num_points3D = 30
    pycolmap.synthesize_dataset(options).write(folder)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture
def model(written, tmp_path):
    for name, content in written.items():
        (tmp_path / name).write_bytes(content)
    return tmp_path


def test_what_colmap_writes_is_taken(model):
    assert sorted(FILES) == sorted(p.name for p in model.glob("*.bin"))
    colmap_models.check_binaries(model)


@pytest.mark.usefixtures("ten_seconds")
@pytest.mark.parametrize("name", [*FILES, "points3D.txt", "rigs.txt"])
def test_a_pipe_is_not_waited_for(model, name):
    """COLMAP's reader would."""
    (model / name).unlink(missing_ok=True)
    os.mkfifo(model / name)
    with pytest.raises(ValueError, match=rf"{name}: not a file"):
        colmap_models.check_binaries(model)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("kept", [0, 7, 8, 0.3, 0.7, -9, -1])
def test_a_file_that_was_cut_is_named(model, name, kept):
    path = model / name
    content = path.read_bytes()
    size = kept if isinstance(kept, int) else int(kept * len(content))
    path.write_bytes(content[:size])
    with pytest.raises(ValueError, match=rf"{name}: truncated or damaged"):
        colmap_models.check_binaries(model)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("how", ["more entries", "fewer entries", "text", "longer"])
def test_a_file_that_says_another_size_is_named(model, name, how):
    content = (model / name).read_bytes()
    changed = {
        "more entries": (2**60).to_bytes(8, "little") + content[8:],
        "fewer entries": bytes(8) + content[8:],
        "text": b"hello\n" * 99,
        "longer": content + b"\0",
    }[how]
    (model / name).write_bytes(changed)
    with pytest.raises(ValueError, match=rf"{name}: truncated or damaged"):
        colmap_models.check_binaries(model)


def test_every_camera_model_of_colmap_is_known():
    for name, number in pycolmap.CameraModelId.__members__.items():
        if name != "INVALID":
            camera = pycolmap.Camera.create_from_model_id(1, number, 100.0, 10, 10)
            assert colmap_models.PARAMETERS[int(number)] == len(camera.params), name
