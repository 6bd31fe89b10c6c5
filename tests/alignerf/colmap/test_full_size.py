"""The photos of a prepared scene, read once more at their own size."""

import numpy as np
import pytest

from alignerf import poses
from alignerf.colmap import loading
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.io import images
from alignerf.scenes import prepare, prepared
from tests import courtyard_photos, export_cases

OF_COURTYARD = export_cases.OF_COURTYARD | {
    "courtyard": {"views": 4, "width": 96, "height": 72}
}


def same(config, out, work):
    """The views at full size, which made smaller are the prepared ones to the bit."""
    config = of_scenes.checked(config)
    poses.main(config, out)
    views = loading.read(config, out, work)
    small = prepare.downscale(views, config.downscale)
    arrays = prepared.read_cameras(out / "cameras.npz")
    assert views.names == arrays["names"].tolist()
    assert views.split.tolist() == arrays["split"].tolist()
    np.testing.assert_array_equal(views.camtoworlds, arrays["camtoworlds"])
    np.testing.assert_allclose(small.pixtocams, arrays["pixtocams"], rtol=1e-12)
    for name, photo in zip(small.names, small.photos, strict=True):
        stored = images.read(out / "images" / f"{name}.png")
        np.testing.assert_array_equal(photo.read(), stored)
    return views


def test_of_the_courtyard(tmp_path):
    (tmp_path / "work").mkdir()
    views = same(OF_COURTYARD, tmp_path / "out", tmp_path / "work")
    assert (views.width, views.height) == (96, 72)


@pytest.mark.whole
def test_other_cameras_of_the_same_views(tmp_path):
    (tmp_path / "work").mkdir()
    poses.main(OF_COURTYARD, tmp_path / "out")
    arrays = prepared.read_cameras(tmp_path / "out" / "cameras.npz")
    arrays["camtoworlds"][:, :, 3] += 0.25
    np.savez(tmp_path / "moved.npz", **arrays)
    config = of_scenes.checked(OF_COURTYARD)
    views = loading.read(
        config, tmp_path / "out", tmp_path / "work", tmp_path / "moved.npz"
    )
    np.testing.assert_array_equal(views.camtoworlds, arrays["camtoworlds"])


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    """A folder of ten neighbouring photos, one of another size, with masks."""
    folder = tmp_path_factory.mktemp("photos")
    names, *_ = courtyard_photos.write(folder, 10)
    odd = folder / "view 4.png"
    images.write(odd, images.read(odd)[20:])
    mask = np.full((180, 240, 3), 255, np.uint8)
    mask[:, :20] = 0
    (folder / "masks").mkdir()
    for name in names:
        own = mask[20:] if name == "view 4" else mask
        images.write(folder / "masks" / f"{name}.png", own)
    return folder


@pytest.mark.whole
def test_of_photos_by_the_lenses_that_colmap_found(photos, tmp_path):
    (tmp_path / "work").mkdir()
    config = {
        "source": "photos",
        "path": str(photos),
        "masks": str(photos / "masks"),
        "downscale": 2,
    }
    views = same(config, tmp_path / "out", tmp_path / "work")
    assert len(views.masks) == len(views.names) == 10
    assert len(views.points[0]) > 50
    config = of_scenes.checked(config)
    (photos / "view 9.png").rename(tmp_path / "gone.png")
    with pytest.raises(ValueError, match="the photo 'view 9' is gone"):
        loading.read(config, tmp_path / "out", tmp_path / "work")
