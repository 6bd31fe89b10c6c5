"""COLMAP's files are read as COLMAP writes them, and never believed."""

import numpy as np
import pycolmap
import pytest

from alignerf.colmap import structure
from alignerf.readers import colmap_models

FILES = [f"{name}.bin" for name in colmap_models.PARTS]


@pytest.fixture(scope="module")
def made():
    """Two rigs of two cameras, whose images have poses of their own."""
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_cameras_per_rig = 2, 2
    options.num_frames_per_rig, options.num_points3D = 4, 30
    return pycolmap.synthesize_dataset(options)


@pytest.fixture(scope="module")
def written(made, tmp_path_factory):
    folder = tmp_path_factory.mktemp("model")
    made.write(folder)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture
def model(written, tmp_path):
    for name, content in written.items():
        (tmp_path / name).write_bytes(content)
    return tmp_path


@pytest.mark.parametrize("as_text", [False, True])
def test_a_model_is_read_as_colmap_has_it(made, tmp_path, as_text):
    (made.write_text if as_text else made.write)(tmp_path)
    found = colmap_models.cameras_of(tmp_path)
    images = {image.name: image for image in made.images.values()}
    assert {shot.name for shot in found.shots} == images.keys()
    for shot in found.shots:
        image = images[shot.name]
        camera = made.cameras[image.camera_id]
        np.testing.assert_allclose(shot.pose, structure.pose_of(image), atol=1e-12)
        lens = structure.lens(camera.model.name, camera.params)
        np.testing.assert_array_equal(shot.lens[0], lens[0])
        np.testing.assert_array_equal(shot.lens[1], lens[1])
        assert shot.size == (camera.width, camera.height)
    points = {tuple(p.xyz.round(9)): p.color for p in made.points3D.values()}
    for xyz, colour in zip(*found.points, strict=True):
        np.testing.assert_array_equal(points[tuple(xyz.round(9))], colour)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("kept", [0, 7, 8, 0.3, 0.7, -9, -1])
def test_a_file_that_was_cut_is_named(model, name, kept):
    path = model / name
    content = path.read_bytes()
    size = kept if isinstance(kept, int) else int(kept * len(content))
    path.write_bytes(content[:size])
    with pytest.raises(ValueError, match=rf"{name}: truncated or damaged"):
        colmap_models.cameras_of(model)


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
        colmap_models.cameras_of(model)


def test_every_camera_model_of_colmap_is_known(tmp_path):
    for name, number in pycolmap.CameraModelId.__members__.items():
        if name in ("INVALID", "EQUIRECTANGULAR"):
            continue
        model = pycolmap.Reconstruction()
        camera = pycolmap.Camera.create_from_model_id(1, number, 100.0, 10, 10)
        model.add_camera_with_trivial_rig(camera)
        model.write(tmp_path)
        ((lens, size),) = colmap_models.binary_lenses(tmp_path / "cameras.bin").values()
        assert (lens[0][0, 0], size) == (100.0, (10, 10)), name
