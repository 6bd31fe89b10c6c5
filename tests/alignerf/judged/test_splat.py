"""Renders of a splat's own file at the photos' cameras."""

import json

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf.judged import camera_files, gsplat, likeness, splat, views
from alignerf.scenes import photos as decode
from alignerf.splats import ply, rasterize
from tests import splat_cases
from tests.judged_cases import write_png

SIZE = (96, 72)
NAMES = [f"v{i:02}" for i in range(5)]
TURN = cv2.Rodrigues(np.array([0.3, -0.5, 0.8]))[0]


def similarity(scale=1.0, turn=None, shift=(0, 0, 0)):
    world = np.eye(4)
    world[:3, :3] = scale * (np.eye(3) if turn is None else turn)
    world[:3, 3] = shift
    return world


def columns(rng, world, count=400):
    """{property: values} of a splat in front of the cameras, in a world of its own."""
    means = rng.uniform([-2, -1.5, -6], [2, 1.5, -4], (count, 3))
    table = splat_cases.columns(rng, rest=0, count=count)
    moved = means @ world[:3, :3].T + world[:3, 3]
    table |= dict(zip("xyz", moved.T, strict=True))
    # Balls, which no turn changes.
    size = np.log(0.12 * splat.scale_of(world))
    table |= {f"scale_{i}": np.full(count, size) for i in range(3)}
    return table | {"opacity": np.full(count, 3.0)}


@pytest.fixture
def project(tmp_path):
    """Photos that a splat shows, their cameras, and what writes it for a world."""
    frames = []
    for i, name in enumerate(NAMES):
        pose = np.eye(4)
        pose[:3, 3] = [0.3 * i - 0.6, 0.1 * i, 0.2 * i]
        frames.append({"file_path": f"{name}.png", "transform_matrix": pose.tolist()})
    keys = {"w": SIZE[0], "h": SIZE[1], "fl_x": 90.0, "fl_y": 91.0, "cx": 47, "cy": 37}

    def write(world, **more):
        file = tmp_path / "transforms.json"
        file.write_text(json.dumps(keys | {"frames": frames} | more))
        rng = np.random.default_rng(3)
        path = splat_cases.write(tmp_path / "model.ply", columns(rng, world))
        if not (tmp_path / "photos").is_dir():
            return path, camera_files.read(file)
        return path, views.taken(tmp_path / "photos", file)

    path, cameras = write(np.eye(4))
    for name, shot in zip(NAMES, cameras.shots, strict=True):
        camera = rasterize.Camera(
            splat.world_to_camera(shot.pose, np.eye(4)), 90, 91, 47, 37, *SIZE
        )
        image = likeness.to_bytes(rasterize.render(ply.read(path), camera).colour)
        write_png(tmp_path / "photos" / f"{name}.png", image)
    photos = {name: tmp_path / "photos" / f"{name}.png" for name in NAMES}
    return write, photos, tmp_path


def applied():
    return [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]]


@pytest.mark.parametrize("scale", [2.0, 0.3, 0.0, -1.0])
def test_cameras_of_a_training_that_lie_mirrored_tell_no_world(project, scale):
    _, own = project[0](np.eye(4))
    poses = [shot.pose * [1, 1, 1, scale] for shot in own.shots]
    pairs = zip(own.shots, poses, strict=True)
    theirs = own._replace(shots=[shot._replace(pose=pose) for shot, pose in pairs])
    world = splat.similarity(own, theirs)
    if scale < 0:
        assert world is None
    else:
        np.testing.assert_allclose(splat.scale_of(world), scale or 1.0)


@pytest.mark.parametrize(
    ("world", "more", "beside", "says"),
    [
        (similarity(), {}, None, "as the cameras'"),
        (
            np.linalg.inv(np.vstack([applied(), [0, 0, 0, 1]])),
            {"applied_transform": applied()},
            None,
            "without the cameras' applied_transform",
        ),
        (
            similarity(0.2) @ similarity(1, TURN, (1, 2, 3)),
            {},
            {"transform": similarity(1, TURN, (1, 2, 3))[:3].tolist(), "scale": 0.2},
            "by dataparser_transforms.json",
        ),
    ],
)
def test_the_world_of_a_splat_is_found_by_the_photos(
    project, world, more, beside, says
):
    """Renders are the photos, and depth is in the unit of the cameras."""
    write, photos, folder = project
    if beside:
        (folder / splat.NERFSTUDIO).write_text(json.dumps(beside))
    path, cameras = write(world, **more)
    told = splat.render(path, cameras, folder / "made", [path])
    assert (told["world"], told["gaussians"]) == (says, 400)
    for name in NAMES:
        render = cv2.imread(str(folder / "made" / "rgb" / f"{name}.png"))
        wanted = cv2.imread(str(photos[name]))
        # Spheres of colours turn with the world, which degree 0 has not.
        assert np.abs(render.astype(int) - wanted).max() <= 2
        depth = np.load(folder / "made" / "depth" / f"{name}.npy")
        known = depth[np.isfinite(depth)]
        assert known.size
        assert (known > 3).all()
        assert (known < 8).all()
    assert splat.is_of(folder / "made", [path])
    path.write_bytes(path.read_bytes() + b" ")
    assert not splat.is_of(folder / "made", [path])


def test_the_cameras_of_its_training_tell_its_world(project):
    """OpenSplat centres and scales cameras, and writes them beside its .ply."""
    world = similarity(0.3, TURN, (1, 2, 3))
    write, photos, folder = project
    path, cameras = write(world)
    entries = []
    for shot in cameras.shots:
        pose = splat.world_to_camera(shot.pose, world)
        place = -pose[:, :3].T @ pose[:, 3]
        entry = {"img_name": f"{shot.name}.png", "width": SIZE[0], "height": SIZE[1]}
        entry |= {"fx": 90.0, "fy": 91.0, "position": place.tolist()}
        entries.append(entry | {"rotation": pose[:, :3].T.tolist()})
    (folder / "cameras.json").write_text(json.dumps(entries))
    told = splat.render(path, cameras, folder / "made")
    assert told["world"] == "by the cameras.json of its training"
    render = cv2.imread(str(folder / "made" / "rgb" / "v03.png")).astype(int)
    assert np.abs(render - cv2.imread(str(photos["v03"]))).max() <= 2
    for entry in entries:
        entry |= {"width": SIZE[0] // 2, "height": SIZE[1] // 2, "fx": 45.0, "fy": 45.5}
    (folder / "cameras.json").write_text(json.dumps(entries))
    splat.render(path, cameras, folder / "small")
    small = cv2.imread(str(folder / "small" / "rgb" / "v03.png"))
    # As large as the photos that it was trained on.
    assert small.shape[:2] == (SIZE[1] // 2, SIZE[0] // 2)
    assert splat.trained_px(path, cameras) == max(SIZE) // 2
    # 3DGS writes the photos' own size, and how much smaller it has made them.
    for asked, taken, px in (
        *((-1, "images", 1), (1, "images", 1), (2, "images", 0.5)),
        *((-1, "images_4", 0.25), (2, "images_2", 0.25), (-1, "a_4", 1)),
        (SIZE[0] // 8, "images", 0.25),
    ):
        noted = f"Namespace(images='{taken}', resolution={asked}, source_path='a')"
        (folder / "cfg_args").write_text(noted)
        assert splat.trained_px(path, cameras) == px * max(SIZE) // 2
    (folder / "cfg_args").unlink()
    (folder / "cameras.json").write_text("[{}]")
    with pytest.raises(ValueError, match="does not show the photos"):
        splat.render(path, cameras, folder / "again")


def by_scipy(poses, points):
    """gsplat's normalization, step by step, as its parser describes them."""
    up = poses[:, :, 1].mean(axis=0)
    axis = np.cross(up, [0, -1, 0])
    angle = np.arccos(np.clip(-up[1] / np.linalg.norm(up), -1, 1))
    turn = Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle)
    at, ahead = turn.apply(poses[:, :, 3]), turn.apply(-poses[:, :, 2])
    nearest = [one - (one @ way) * way for one, way in zip(at, ahead, strict=True)]
    middle = np.median(nearest, axis=0)
    scale = 1 / np.median([np.linalg.norm(one - middle) for one in at])
    first = similarity(scale, turn.as_matrix(), -scale * middle)
    points = points @ first[:3, :3].T + first[:3, 3]
    centre = np.median(points, axis=0)
    axes = np.linalg.svd(points - points.mean(axis=0))[2]
    axes[0] *= np.linalg.det(axes)
    return similarity(1, axes, -axes @ centre) @ first


def turned_poses(rng, count):
    turns = Rotation.random(count, rng=rng).as_matrix()
    return np.concatenate([turns, rng.normal(size=(count, 3, 1))], axis=-1)


@pytest.mark.parametrize("seed", range(8))
def test_the_world_of_gsplat_is_one_of_four_half_turns(seed):
    rng = np.random.default_rng(seed)
    poses = turned_poses(rng, rng.integers(3, 30))
    points = rng.normal(size=(100, 3)) * rng.uniform(0.1, 5, 3) + rng.normal(size=3)
    points = Rotation.random(rng=rng).apply(points)
    found = gsplat.worlds(poses, points)
    assert len(found) == 4
    wanted = by_scipy(poses, points)
    assert min(np.abs(one - wanted).max() for one in found.values()) < 1e-9
    assert all(np.linalg.det(one[:3, :3]) > 0 for one in found.values())


def test_cameras_and_points_that_gsplat_cannot_normalize_have_none_of_its_worlds():
    poses, points = np.eye(4)[None, :3], np.random.default_rng(0).normal(size=(9, 3))
    assert gsplat.worlds(poses, points) == {}
    poses = turned_poses(np.random.default_rng(0), 5)
    assert gsplat.worlds(poses, points[:3]) == {}
    assert gsplat.worlds(poses, points * np.nan) == {}


@pytest.mark.parametrize("which", range(4))
def test_a_splat_of_gsplat_is_shown_as_it_comes(project, which):
    """By all cameras of the file, also those whose photos are not given."""
    write, photos, folder = project
    turned = similarity(2.0, TURN, (3, 1, 2))
    rng = np.random.default_rng(which)
    points = rng.uniform([-2, -1.5, -6], [2, 1.5, -4], (50, 3)) * [1, 0.7, 1.2]
    points = points @ turned[:3, :3].T + turned[:3, 3]
    xyz = dict(zip("xyz", points.T, strict=True))
    splat_cases.write(folder / "points.ply", xyz)
    frames = json.loads((folder / "transforms.json").read_text())["frames"]
    for frame in frames:
        pose = turned @ np.array(frame["transform_matrix"])
        pose[:3, :3] /= 2
        frame["transform_matrix"] = pose.tolist()
    more = {"frames": frames, "ply_file_path": "points.ply"}
    _, cameras = write(similarity(), **more)
    poses = [shot.pose for shot in cameras.shots]
    name, world = list(gsplat.worlds(poses, cameras.points[0]).items())[which]
    photos["v00"].unlink()
    path, cameras = write(world @ turned, **more)
    assert splat.render(path, cameras, folder / "made")["world"] == name
    render = cv2.imread(str(folder / "made" / "rgb" / "v03.png")).astype(int)
    assert np.abs(render - cv2.imread(str(photos["v03"]))).max() <= 2


def test_the_size_of_training_is_told_or_noted(project, caplog):
    """gsplat notes a divisor; where no file says it, the user may."""
    write, _photos, folder = project
    path, cameras = write(similarity())

    def width(name, **more):
        splat.render(path, cameras, folder / name, [path], **more)
        return cv2.imread(str(folder / name / "rgb" / "v03.png")).shape[1]

    assert width("whole") == SIZE[0]
    assert "--size 48" in caplog.text
    caplog.clear()
    assert width("told", size=32) == 32
    assert splat.is_of(folder / "told", [path], size=32)
    assert not splat.is_of(folder / "told", [path])
    (folder / "cfg.yml").write_text("ckpt: null\ndata_factor: 2\nport: 8080\n")
    assert width("noted") == SIZE[0] // 2
    assert "no file says" not in caplog.text


def test_cameras_of_another_scene_are_refused_in_one_line(project):
    write, _photos, folder = project
    path, cameras = write(similarity(turn=TURN, shift=(40, 0, 0)))
    with pytest.raises(ValueError, match=r"does not show the photos \(likeness") as no:
        splat.render(path, cameras, folder / "made")
    for help in (
        "cameras.json",
        "dataparser_",
        "--no-normalize-world-space",
        "RENDERS",
    ):
        assert help in str(no.value)
    assert not (folder / "made").exists()


@pytest.mark.parametrize("axis", range(3))
def test_a_mirrored_splat_is_refused(project, axis):
    """Its outline on black is nearly the same."""
    write, _photos, folder = project
    world = similarity()
    world[axis, axis] = -1
    path, cameras = write(world)
    said = rf"are mirrored \(as the cameras', mirrored in {'xyz'[axis]}\)"
    with pytest.raises(ValueError, match=said):
        splat.render(path, cameras, folder / "made")


@pytest.mark.parametrize("seed", range(5))
def test_another_splat_in_the_same_outline_is_refused(project, seed):
    write, _photos, folder = project
    path, cameras = write(similarity())
    rng = np.random.default_rng(100 + seed)
    splat_cases.write(path, columns(rng, np.eye(4)))
    with pytest.raises(ValueError, match="does not show the photos"):
        splat.render(path, cameras, folder / "made")


def spoil(photos, noise, alike, change=lambda images: images, seed=0):
    """Rewrite photos with noise as fine as what is compared, and more in common."""
    rng = np.random.default_rng(seed)
    images = np.array([cv2.imread(str(photos[name]))[..., ::-1] for name in NAMES])
    images = (images + alike * images.mean(axis=0)) / (1 + alike)
    for name, image in zip(NAMES, change(list(images)), strict=True):
        grey = cv2.GaussianBlur(rng.normal(size=SIZE[::-1]), (0, 0), 2.5)
        spoilt = image + noise * (grey / grey.std())[..., None]
        write_png(photos[name], np.uint8(spoilt.clip(0, 255)))


@pytest.mark.parametrize("seed", range(4))
def test_a_poor_splat_is_taken(project, seed):
    """So trainers make them of cameras that are off."""
    write, photos, folder = project
    path, cameras = write(similarity())
    spoil(photos, 58, 0, seed=seed)
    told = splat.render(path, cameras, folder / "made")
    assert likeness.SHOWS < told["likeness"] < likeness.SURE
    assert told["world"] == "as the cameras'"


@pytest.mark.parametrize(("noise", "alike"), [(0, 0), (40, 0), (20, 1)])
@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda images: images[-1:] + images[:-1],
            r"the camera of v0\d it shows v0\d:",
        ),
        (lambda images: [i[:, ::-1] for i in images], "mirrored"),
        (lambda images: [i[::-1] for i in images], "mirrored"),
    ],
)
def test_photos_of_other_names_or_mirrored_are_named(
    project, change, says, noise, alike
):
    write, photos, folder = project
    path, cameras = write(similarity())
    spoil(photos, noise, alike, change)
    with pytest.raises(ValueError, match=says):
        splat.render(path, cameras, folder / "made")


@pytest.mark.parametrize("off_px", [0, 3])
@pytest.mark.parametrize(("gain", "gamma"), [(0.4, 1), (1, 0.5), (1, 2), (2, 1)])
@pytest.mark.parametrize("sigma_px", [0.5, 1.5])
def test_soft_splats_of_wrong_poses_and_exposures_are_taken(
    project, off_px, gain, gamma, sigma_px
):
    write, photos, folder = project
    path, cameras = write(similarity())
    for path_of in photos.values():
        photo = np.roll(cv2.imread(str(path_of)), off_px, axis=(0, 1)) / 255
        photo = cv2.GaussianBlur(photo, (0, 0), sigma_px) ** gamma * gain
        write_png(path_of, likeness.to_bytes(photo[..., ::-1]))
    assert splat.render(path, cameras, folder / "made")["likeness"] > 0.5


def test_a_splat_of_cut_outs_is_rendered_before_their_background(project):
    """NeRF's synthetic scenes are trained before white."""
    write, photos, folder = project
    path, cameras = write(similarity())
    for shot in cameras.shots:
        view = splat.View(shot)
        made = view.render(ply.read(path), np.eye(4), SIZE[0])
        straight = made.colour / np.maximum(made.alpha, 1e-6)[..., None]
        cut_out = np.concatenate([straight, made.alpha[..., None]], axis=-1)
        write_png(shot.photo, likeness.to_bytes(cut_out))
    with pytest.raises(ValueError, match=r"v00\.png has transparent pixels"):
        splat.render(path, cameras, folder / "made")
    for background in ("white", "black"):
        place = folder / background
        told = splat.render(path, cameras, place, [path], background)
        assert told["likeness"] > 0.95
        assert splat.is_of(place, [path], background)
        assert not splat.is_of(place, [path])
        for name, photo in photos.items():
            render = cv2.imread(str(place / "rgb" / f"{name}.png"))[..., ::-1]
            wanted = decode.as_stored(photo, background).astype(int)
            # Straight colours over 1 are cut.
            assert np.abs(render - wanted).mean() < 0.5


def test_a_similarity_that_is_none_is_named(project):
    write, _photos, folder = project
    path, cameras = write(similarity())
    told = {"transform": [[0, 0, 0, 0]] * 3, "scale": 1}
    (folder / splat.NERFSTUDIO).write_text(json.dumps(told))
    with pytest.raises(ValueError, match=r"transforms\.json: 'transform' and"):
        splat.render(path, cameras, folder / "made")
