"""Photos and the cameras that came with them, of a corner of a room that is known."""

import json
import logging

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf.captures import mipnerf360, transforms
from alignerf.courtyard import scene
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.io import images
from alignerf.readers import shots
from alignerf.scenes import cameras, distortion
from alignerf.sfm import pairing

SIZE = WIDTH, HEIGHT = 256, 192
COUNT = 10
NAMES = [f"p{i}.png" for i in range(COUNT)]
CAMTOPIX = np.array([[130.0, 0, 128], [0, 130, 96], [0, 0, 1]])
LENSES = {
    "OPENCV_FISHEYE": np.array([0.05, -0.01, 4e-3, -1e-3]),
    "OPENCV": np.array([-0.2, 0.04, 0.0, 0.0, 0.0]),
}
PINHOLE = np.zeros(5)
# As undistorting changes it.
OTHER = CAMTOPIX * [[0.8, 1, 1], [1, 0.8, 1], [1, 1, 1]]


def poses():
    """[n, 3, 4] on an arc, OpenGL axes, towards the corner at the origin."""
    angles = np.radians(np.linspace(15, 75, COUNT))
    places = [np.cos(angles), np.sin(angles), 0.5 + 0.1 * np.sin(9 * angles)]
    towards = np.array([0.4, 0.4, 0.6])
    return np.array([scene.look_at(3 * one, towards) for one in np.transpose(places)])


def photo(camtopix, lens, pose, walls):
    """What a lens sees of three walls through the origin."""
    y, x = np.indices((HEIGHT, WIDTH)) + 0.5
    points = distortion.camera(camtopix, lens).cam_from_img(
        np.stack([x, y], axis=-1).reshape(-1, 2)
    )
    rays = np.concatenate([points, np.ones((len(points), 1))], axis=1)
    rays = rays @ (pose[:, :3] @ cameras.OPENGL_FROM_OPENCV).T
    depths = -pose[:, 3] / rays
    depths[depths <= 0] = np.inf
    wall = depths.argmin(axis=1)
    hit = pose[:, 3] + depths.min(axis=1)[:, None] * rays
    image = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    for k, texture in enumerate(walls):
        u, v = (np.delete(hit, k, axis=1) * 120).astype(np.float32).T
        u, v = u.reshape(HEIGHT, WIDTH), v.reshape(HEIGHT, WIDTH)
        seen = cv2.remap(texture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        own = wall.reshape(HEIGHT, WIDTH) == k
        image[own] = seen[own]
    return image


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    """(folder with a folder of photos of each kind, their poses)."""
    rng, folder = np.random.default_rng(3), tmp_path_factory.mktemp("taken")
    walls = []
    for _ in range(3):
        noise = sum(
            cv2.resize(
                rng.normal(size=(side, side, 3)),
                (512, 512),
                interpolation=cv2.INTER_CUBIC,
            )
            for side in (16, 48, 128)
        )
        walls.append(np.clip(128 + 40 * noise, 0, 255).astype(np.uint8))
    kinds = {"pinhole": (CAMTOPIX, PINHOLE), "other": (OTHER, PINHOLE)}
    kinds |= {model: (CAMTOPIX, lens) for model, lens in LENSES.items()}
    for kind, lens in kinds.items():
        (folder / kind).mkdir()
        for name, pose in zip(NAMES, poses(), strict=True):
            images.write(folder / kind / name, photo(*lens, pose, walls))
    return folder


def write_model(folder, model):
    (fx, _, cx), (_, fy, cy), _ = CAMTOPIX
    lens = LENSES.get(model, ())
    params = " ".join(map(str, [fx, fy, cx, cy, *lens[:4]]))
    folder.mkdir(parents=True)
    (folder / "cameras.txt").write_text(f"1 {model} {WIDTH} {HEIGHT} {params}\n")
    lines = []
    for i, (name, pose) in enumerate(zip(NAMES, poses(), strict=True)):
        turn = (pose[:, :3] @ cameras.OPENGL_FROM_OPENCV).T
        x, y, z, w = Rotation.from_matrix(turn).as_quat()
        numbers = (w, x, y, z, *(-turn @ pose[:, 3]))
        lines.append(f"{i + 1} {' '.join(map(str, numbers))} 1 {name}\n\n")
    (folder / "images.txt").write_text("".join(lines))


def read(folder, capture=mipnerf360):
    scene = {"source": capture.CAPTURE.name, "path": str(folder)}
    views, _ = capture.CAPTURE.read_given(of_scenes.checked(scene))
    assert len(views.names) == COUNT
    return views.photos[0].path.parent.name, np.linalg.inv(views.pixtocams[0])


SAID = "which are undistorted already: their distortion is left out"
LEFT, CHANGED = SAID + " (", SAID + ", and their focal length is 0.8"


def both(model):
    """ScanNet++'s photos, as taken and as undistorted."""
    return model, {"a_images": model, "a_undistorted_images": "pinhole"}, "a_images", ""


PAIRS = [
    both("OPENCV_FISHEYE"),
    ("OPENCV", {"images": "pinhole"}, "images", LEFT),
    ("OPENCV_FISHEYE", {"images": "other"}, "images", CHANGED),
    ("OPENCV", {"images": "OPENCV"}, "images", ""),
    (
        "PINHOLE",
        {"images": "OPENCV", "undistorted": "pinhole"},
        "undistorted",
        "photos of",
    ),
]
# What differs in the lens, or in a folder's name, alone.
WHOLE = [
    both("OPENCV"),
    ("OPENCV_FISHEYE", {"images": "pinhole"}, "images", LEFT),
    ("OPENCV_FISHEYE", {"images": "OPENCV_FISHEYE"}, "images", ""),
    ("OPENCV", {"images": "OPENCV", "input": "pinhole"}, "images", "photos of"),
]


@pytest.mark.parametrize(
    ("model", "folders", "wanted", "said"),
    [*PAIRS, *(pytest.param(*one, marks=pytest.mark.whole) for one in WHOLE)],
)
def test_a_model_gets_the_photos_and_the_lens_that_fit(
    tmp_path, taken, caplog, model, folders, wanted, said
):
    caplog.set_level(logging.INFO)
    write_model(tmp_path / "colmap", model)
    for name, kind in folders.items():
        (tmp_path / name).symlink_to(taken / kind)
    own, camtopix = read(tmp_path)
    assert own == wanted
    assert said in caplog.text
    assert ("undistorted already" in caplog.text) == (SAID in said)
    lens = LENSES[model] if model in LENSES and SAID not in said else PINHOLE
    true = OTHER if said == CHANGED else CAMTOPIX
    if lens is not PINHOLE:
        true = distortion.pinhole_camera(CAMTOPIX, lens, *SIZE)
    np.testing.assert_allclose(camtopix, true, rtol=5e-3)


def test_a_files_photos_of_another_folder_are_tried_too(tmp_path, taken, caplog):
    caplog.set_level(logging.INFO)
    (tmp_path / "undistorted").symlink_to(taken / "pinhole")
    content = {
        "fl_x": CAMTOPIX[0, 0],
        "w": WIDTH,
        "h": HEIGHT,
        "camera_model": "OPENCV",
    }
    content |= dict(zip(("k1", "k2"), LENSES["OPENCV"], strict=False))
    content["frames"] = [
        {"file_path": f"images/{name}", "transform_matrix": pose.tolist()}
        for name, pose in zip(NAMES, poses(), strict=True)
    ]
    (tmp_path / "transforms.json").write_text(json.dumps(content))
    np.testing.assert_allclose(read(tmp_path, transforms)[1], CAMTOPIX)
    assert LEFT in caplog.text


@pytest.mark.parametrize(
    "kind", ["alone", "alike", "blank", "broken", "one", "empty", "wrong"]
)
def test_without_anything_to_tell_the_first_folder_and_the_lens_stay(
    taken, tmp_path, kind, rng, monkeypatch
):
    lens, given = LENSES["OPENCV"], poses()
    folders = [{name: taken / "OPENCV" / name for name in NAMES}] * 2
    if kind == "alone":
        lens, folders = PINHOLE, folders[:1]
        monkeypatch.setattr(pairing, "matched", None)
    if kind in ("blank", "broken"):
        images.write(tmp_path / "a.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
        if kind == "broken":
            (tmp_path / "a.png").write_bytes(b"x")
        folders[0] = dict.fromkeys(NAMES, tmp_path / "a.png")
    if kind == "wrong":
        folders = [{name: taken / "pinhole" / name for name in NAMES}]
        given[:, :, :3] = Rotation.random(COUNT, rng=rng).as_matrix()
    size = (0, 0) if kind == "empty" else SIZE
    cams = [
        shots.Shot(name, (CAMTOPIX, lens), pose, size)
        for name, pose in zip(NAMES, given, strict=True)
        if kind != "one" or name == NAMES[0]
    ]
    k, found = pairing.choose("model", cams, folders)
    assert k == 0
    assert found is cams
