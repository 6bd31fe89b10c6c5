"""What tests of exports share: a scene, the command, and what its folders must hold."""

import json

import numpy as np
import pycolmap
from PIL import Image

from alignerf import export
from alignerf.colmap import structure
from alignerf.io import faults
from alignerf.readers import transforms
from alignerf.scenes import cameras

WIDTH, HEIGHT = 192, 144
OF_COURTYARD = {
    "source": "courtyard",
    "poses": "truth",
    "downscale": 2,
    "test_every": 3,
    "min_train_views": 2,
    "courtyard": {"views": 8, "width": WIDTH, "height": HEIGHT},
}


def run(made, out, *more, config=OF_COURTYARD):
    words = ["--scene", made, "--config", json.dumps(config), "--out", out, *more]
    return faults.exit_code(export.main, [str(word) for word in words])


def exported(made, folder, *more, **options):
    assert run(made, folder / "out", *more, **options) == 0
    return folder / "out"


def check_cameras(out, wanted, atol=1e-6):
    """That pycolmap and our own reader have the same cameras as `wanted`."""
    found, left_out = transforms.read(out)
    assert left_out == []
    assert found.names == wanted.names
    assert (found.width, found.height) == (wanted.width, wanted.height)
    assert found.split.tolist() == wanted.split.tolist()
    model = pycolmap.Reconstruction(out / "sparse" / "0")
    of_colmap = structure.convert(model, wanted.names)
    assert of_colmap.names == wanted.names
    sizes = {(one.width, one.height) for one in model.cameras.values()}
    assert sizes == {(wanted.width, wanted.height)}
    camtopix = np.linalg.inv(wanted.pixtocams)
    for mine in (np.linalg.inv(found.pixtocams), of_colmap.camtopix):
        np.testing.assert_allclose(mine, camtopix, rtol=0, atol=atol)
    for mine in (found.camtoworlds, of_colmap.camtoworlds):
        np.testing.assert_allclose(mine, wanted.camtoworlds, rtol=0, atol=atol)
    return model, found


def check_points(model, wanted, at_most_px):
    """That points land, by COLMAP's camera and by ours, where their photos see them."""
    place = {f"{name}.png": i for i, name in enumerate(wanted.names)}
    away_px, apart_px = [], []
    for image in model.images.values():
        i = place[image.name]
        for seen in (p for p in image.points2D if p.has_point3D()):
            point = model.points3D[seen.point3D_id].xyz
            camera = wanted.pixtocams[i], wanted.camtoworlds[i]
            ours = cameras.project(point[None], *camera)[0][0]
            apart_px.append(np.linalg.norm(ours - image.project_point(point)))
            away_px.append(np.linalg.norm(ours - seen.xy))
    assert len(away_px) > 50
    assert max(apart_px) < 1e-6
    assert np.median(away_px) < at_most_px


def read_mask(path):
    with Image.open(path) as image:
        assert image.mode == "L"
        return np.asarray(image) > 0
