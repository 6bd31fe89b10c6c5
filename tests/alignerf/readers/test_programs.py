"""Cameras as other programs write them: known points fall where the formats say."""

from pathlib import Path

import numpy as np
import pytest

from alignerf.captures import base as captures
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.judged import camera_files
from alignerf.readers.programs import metashape, reading
from alignerf.scenes import distortion
from tests import app_cases

NAMES = ["IMG 1.JPG", "IMG_2.JPG", "IMG_3.JPG", "IMG_4.JPG"]
SIZE = WIDTH, HEIGHT = 96, 64
FOCAL_PX = 70.0
# From the middle.
CENTRE_PX = np.array([1.5, -2.25])
K, P = (0.05, -0.03, 0.01), (2e-3, -1e-3)


@pytest.fixture
def scene(tmp_path, rng):
    """(folder, {name: camera-to-world [3, 4] with OpenCV's axes})."""
    for name in NAMES:
        app_cases.write_photo(tmp_path / "images" / name, size=SIZE)
    poses = app_cases.camtoworlds(rng, len(NAMES))
    return tmp_path, dict(zip(NAMES, poses, strict=True))


def brown(x, y, k=K, p=P):
    """A point bent as OpenCV does."""
    r2 = x * x + y * y
    radial = 1 + sum(one * r2 ** (i + 1) for i, one in enumerate(k))
    u = x * radial + 2 * p[0] * x * y + p[1] * (r2 + 2 * x * x)
    return u, y * radial + p[0] * (r2 + 2 * y * y) + 2 * p[1] * x * y


def fisheye(x, y, k):
    angle = np.arctan(np.hypot(x, y))
    scale = angle * (1 + sum(one * angle ** (2 * i + 2) for i, one in enumerate(k)))
    return x * scale / np.hypot(x, y), y * scale / np.hypot(x, y)


def check(path, poses, bend, *, centre=CENTRE_PX, names=NAMES):
    """Points in the world fall where they should, by what was read and by hand."""
    given = reading.cameras_of(path).shots
    assert [one.name.rpartition("/")[2] for one in given] == names
    for one, name in zip(given, names, strict=True):
        pose = poses[name]
        x, y = np.array([0.3, -0.4, 0.05]), np.array([-0.2, 0.25, 0.3])
        world = np.stack([x, y, np.ones(3)], axis=-1) * 5 @ pose[:, :3].T + pose[:, 3]
        wanted = FOCAL_PX * np.stack(bend(x, y), axis=-1) + np.array(SIZE) / 2 + centre
        # By OpenGL's axes.
        own = (world - one.pose[:, 3]) @ one.pose[:, :3]
        points = own[:, :2] * [1, -1] / -own[:, 2:]
        assert one.size in (SIZE, None)
        found = distortion.distort_points(points, *one.of_size(SIZE))
        np.testing.assert_allclose(found, wanted, atol=2e-3)


def xml(poses, calibration, kind="frame", more=""):
    cameras = "".join(
        f'<camera id="{i}" sensor_id="0" component_id="0" label="{name}" enabled="1">'
        f"<transform>{' '.join(map(repr, np.vstack([pose, [0, 0, 0, 1]]).ravel()))}"
        "</transform></camera>"
        for i, (name, pose) in enumerate(poses.items())
    ).replace("np.float64(", "")
    values = "".join(f"<{key}>{value}</{key}>" for key, value in calibration.items())
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><document version="2.0.0"><chunk>'
        f'<sensors><sensor id="0" type="{kind}">'
        f'<resolution width="{WIDTH}" height="{HEIGHT}"/>'
        f'<calibration type="{kind}" class="initial"><f>9</f></calibration>'
        f'<calibration type="{kind}" class="adjusted">'
        f'<resolution width="{WIDTH}" height="{HEIGHT}"/>{values}</calibration>'
        f"</sensor></sensors><cameras><group>{cameras}</group>{more}"
        '<camera id="9" sensor_id="0" label="lost"/></cameras>'
        "<transform><rotation>1 0 0 0 1 0 0 0 1</rotation><scale>7</scale></transform>"
        "</chunk></document>"
    ).replace(")", "")


METASHAPE = {
    "f": FOCAL_PX,
    "cx": CENTRE_PX[0],
    "cy": CENTRE_PX[1],
    "k1": K[0],
    "k2": K[1],
    "k3": K[2],
    "p1": P[1],
    "p2": P[0],
}


def test_metashape(scene):
    path = scene[0] / "cameras.xml"
    path.write_text(xml(scene[1], METASHAPE))
    check(path, scene[1], brown)
    # Another component, which is smaller.
    other = '<camera component_id="1" label="a"><transform>1</transform></camera>'
    path.write_text(xml(scene[1], METASHAPE, more=other))
    check(path, scene[1], brown)
    old = {key: METASHAPE[key] for key in ("k1", "k2", "k3", "p1", "p2")}
    old |= {"fx": FOCAL_PX - 3, "fy": FOCAL_PX, "b1": 3}
    old |= {"cx": WIDTH / 2 + CENTRE_PX[0], "cy": HEIGHT / 2 + CENTRE_PX[1]}
    path.write_text(xml(scene[1], old))
    check(path, scene[1], brown)


def test_metashapes_fourth_number_and_its_fisheye(scene):
    path, more = scene[0] / "cameras.xml", {"k4": -0.0761, "k3": 0.116}
    path.write_text(xml(scene[1], METASHAPE | more))
    check(path, scene[1], lambda x, y: brown(x, y, k=(*K[:2], 0.116, -0.0761)))
    fish = METASHAPE | {"p1": 0, "p2": 0, "k4": 0.002}
    path.write_text(xml(scene[1], fish, kind="fisheye"))
    check(path, scene[1], lambda x, y: fisheye(x, y, (*K, 0.002)))


@pytest.mark.parametrize(
    ("change", "kind", "named"),
    [
        ({"b2": 5}, "frame", "b2"),
        ({"k4": 1e9}, "frame", "k4"),
        ({"p3": 0.1}, "frame", "p3"),
        ({"f": "x"}, "frame", "'x'"),
        ({"f": 0}, "frame", "focal"),
        ({}, "spherical", "cube faces"),
    ],
)
def test_what_is_no_lens_of_metashapes_is_named(scene, change, kind, named):
    path = scene[0] / "cameras.xml"
    path.write_text(xml(scene[1], METASHAPE | change, kind=kind))
    with pytest.raises(ValueError, match=named) as caught:
        reading.cameras_of(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_an_xml_that_declares_anything_is_refused(tmp_path, encoding):
    path = tmp_path / "cameras.xml"
    bomb = '<!DOCTYPE d [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><document>&b;<chunk/>'
    path.write_bytes(f"{bomb}</document>".encode(encoding))
    with pytest.raises(ValueError, match=r"cameras.xml: a DOCTYPE"):
        metashape.read(path)
    path.write_text("<document><chunk>")
    with pytest.raises(ValueError, match=r"cameras.xml: not the XML"):
        metashape.read(path)


@pytest.mark.parametrize("suffix", ["", " 0", " 0 532.5"])
def test_bundler(scene, suffix):
    folder, poses = scene
    lines, names = ["# Bundle file v0.3", "5 1"], [*NAMES, "lost.jpg"]
    for pose in poses.values():
        # y up, looking along -z.
        turn = np.diag([1, -1, -1]) @ pose[:, :3].T
        lines += [f"{FOCAL_PX} {K[0]} {K[1]}", *(" ".join(map(str, r)) for r in turn)]
        lines += [" ".join(map(str, -turn @ pose[:, 3]))]
    lines += ["0 0 0"] * 5 + ["0 0 1", "255 0 0", "2 0 0 1 2 1 0 3 4"]
    path = folder / "bundle" / "bundle.out"
    path.parent.mkdir()
    path.write_text("\n".join(lines))
    with pytest.raises(ValueError, match=r"bundle.out: no list of its 5 photos"):
        reading.cameras_of(path)
    (folder / "list.txt").write_text(
        "".join(f"images/{name}{suffix}\n" for name in names)
    )
    check(path, poses, lambda x, y: brown(x, y, K[:2], (0, 0)), centre=np.zeros(2))
    # The middle is each photo's own.
    app_cases.write_photo(folder / "images" / NAMES[0], size=SIZE[::-1])
    assert len(reading.views_of(folder)[0].names) == len(NAMES)
    path.write_text("# Bundle file v0.3\n7 1\n")
    with pytest.raises(ValueError, match=r"bundle.out: cut short"):
        reading.cameras_of(path)


OPENMVG = {
    "pinhole": ({}, lambda x, y: (x, y)),
    "k1": ({"disto_k1": [K[0]]}, lambda x, y: brown(x, y, K[:1], (0, 0))),
    "k3": ({"disto_k3": [*K]}, lambda x, y: brown(x, y, K, (0, 0))),
    "t2": ({"disto_t2": [*K, *P]}, brown),
    "fisheye": ({"fisheye": [*K, 0.002]}, lambda x, y: fisheye(x, y, (*K, 0.002))),
}


@pytest.mark.parametrize("kind", OPENMVG)
@pytest.mark.parametrize("nested", [False, True])
def test_openmvg(scene, kind, nested):
    more, bend = OPENMVG[kind]
    middle = (np.array(SIZE) / 2 + CENTRE_PX).tolist()
    lens = {"width": WIDTH, "height": HEIGHT, "focal_length": FOCAL_PX}
    lens |= {"principal_point": middle}
    lens = ({"value0": lens} if nested else lens) | more
    content = {"sfm_data_version": "0.3", "root_path": "/gone", "views": []}
    content |= {"extrinsics": [], "structure": []}
    content["intrinsics"] = [{"key": 3, "value": {"ptr_wrapper": {"data": lens}}}]
    for i, (name, pose) in enumerate(scene[1].items()):
        view = {"local_path": "images", "filename": name, "id_view": i}
        view |= {"id_intrinsic": 3, "id_pose": i + 7}
        content["views"] += [{"key": i, "value": {"ptr_wrapper": {"data": view}}}]
        value = {"rotation": pose[:, :3].T.tolist(), "center": pose[:, 3].tolist()}
        content["extrinsics"] += [{"key": i + 7, "value": value}]
    lost = {"filename": "lost.jpg", "id_intrinsic": 3, "id_pose": 4294967295}
    content["views"] += [{"key": 9, "value": {"ptr_wrapper": {"data": lost}}}]
    app_cases.write_json(path := scene[0] / "sfm_data.json", content)
    check(path, scene[1], bend)
    del content["views"][1]["value"]["ptr_wrapper"]["data"]["filename"]
    app_cases.write_json(path, content)
    with pytest.raises(ValueError, match=r"sfm_data.json: a part .*filename"):
        reading.cameras_of(path)


F, C = FOCAL_PX / WIDTH, CENTRE_PX / WIDTH
OPENSFM = {
    "perspective": (
        {"focal": F, "k1": K[0], "k2": K[1]},
        lambda x, y: brown(x, y, K[:2], (0, 0)),
    ),
    "brown": (
        {"focal_x": F, "focal_y": F, "c_x": C[0], "c_y": C[1]}
        | dict(zip(("k1", "k2", "k3", "p1", "p2"), (*K, *P), strict=True)),
        brown,
    ),
    "fisheye": (
        {"focal": F, "k1": K[0], "k2": K[1]},
        lambda x, y: fisheye(x, y, K[:2]),
    ),
}


@pytest.mark.parametrize("kind", OPENSFM)
def test_opensfm(scene, kind):
    import cv2

    own, bend = OPENSFM[kind]
    camera = {"projection_type": kind, "width": WIDTH, "height": HEIGHT} | own
    shots = {}
    for name, pose in scene[1].items():
        turn = pose[:, :3].T
        place = {"translation": (-turn @ pose[:, 3]).tolist(), "camera": "v2 a"}
        shots[name] = place | {"rotation": cv2.Rodrigues(turn)[0].ravel().tolist()}
    smaller = {"cameras": {}, "shots": {"a": {}}, "points": {}}
    content = [smaller, {"cameras": {"v2 a": camera}, "shots": shots}]
    app_cases.write_json(path := scene[0] / "reconstruction.json", content)
    middle = CENTRE_PX if kind == "brown" else np.zeros(2)
    check(path, scene[1], bend, centre=middle)
    camera["projection_type"] = "spherical"
    app_cases.write_json(path, content)
    with pytest.raises(ValueError, match=r"IMG 1.JPG: EQUIRECT.*cube faces"):
        reading.cameras_of(path)


def gaussians(poses):
    return [
        {"id": i, "img_name": name, "width": WIDTH, "height": HEIGHT}
        | {"position": pose[:, 3].tolist(), "rotation": pose[:, :3].tolist()}
        | {"fx": FOCAL_PX, "fy": FOCAL_PX}
        for i, (name, pose) in enumerate(poses.items())
    ]


def test_gaussians(scene):
    app_cases.write_json(path := scene[0] / "cameras.json", gaussians(scene[1]))
    check(path, scene[1], lambda x, y: (x, y), centre=np.zeros(2))


def test_the_file_of_most_cameras_is_taken(scene):
    """openMVG writes one before it has any pose, to another folder."""
    folder, poses = scene
    app_cases.write_json(folder / "a" / "cameras.json", gaussians(poses)[:1])
    app_cases.write_json(folder / "b" / "cameras.json", gaussians(poses))
    (folder / "cameras.xml").write_text(xml({}, METASHAPE))
    assert reading.find(folder) == folder / "b" / "cameras.json"


def test_a_folder_becomes_views(scene):
    folder, poses = scene
    assert captures.detected(folder).name == "photos"
    (folder / "export").mkdir()
    (folder / "export" / "model.xml").write_text("<mesh/>")
    (folder / "export" / "cameras.xml").write_text(xml(poses, METASHAPE))
    app_cases.write_photo(folder / "images" / "odd.jpg", size=SIZE)
    (folder / "images" / NAMES[0]).unlink()
    # Half the size, and with its own lens on one canvas.
    app_cases.write_photo(folder / "images" / NAMES[1], size=(WIDTH // 2, HEIGHT // 2))
    record = captures.detected(folder)
    assert record.name == "exported"
    scene = of_scenes.checked(record.scene(folder))
    views, left_out = record.read_given(scene)
    assert sorted(views.names) == ["IMG_2", "IMG_3", "IMG_4"]
    assert left_out == ["IMG 1", "odd"]
    assert (views.width, views.height) == SIZE
    for name, pose in zip(views.names, views.camtoworlds, strict=True):
        turned = poses[f"{name}.JPG"] @ np.diag([1, -1, -1, 1])
        np.testing.assert_allclose(pose, turned, atol=1e-9)
    assert all(one.read().shape == (HEIGHT, WIDTH, 3) for one in views.photos)
    (folder / "images" / NAMES[3]).unlink()
    with pytest.raises(
        ValueError, match=r"no photo IMG 1.JPG, .*cameras.xml has a pose"
    ):
        record.read_given(scene)
    (folder / "export" / "cameras.xml").write_text(xml({}, METASHAPE))
    with pytest.raises(ValueError, match=r"no camera has a pose.*Without this file"):
        record.read_given(scene)


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("cameras.csv", "name,x,y", True),
        ("export/Poses.TXT", "1 2", True),
        ("model.nvm", "NVM_V3", True),
        ("blocks.xml", "<BlocksExchange/>", True),
        ("cameras.json", "{}", True),
        ("images/a.xmp", "<x xcr:Position='1'/>", True),
        ("images/a.xmp", "<x crs:Exposure='1'/>", False),
        ("Registration.csv", "", True),
        ("notes.txt", "sunny", False),
    ],
)
def test_what_is_not_read_is_told_once(scene, caplog, name, content, told):
    path = scene[0] / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(content)
    with caplog.at_level("INFO"):
        record = captures.detected(scene[0])
        assert record.scene(scene[0])["source"] == "photos"
    lines = [one.getMessage() for one in caplog.records]
    line = f"{path.name} is not read: poses come from COLMAP"
    assert [one.endswith(line) for one in lines] == [True] * told


def test_places_in_photos_are_told(scene, caplog):
    from PIL import Image

    exif = Image.Exif()
    exif[34853] = {1: "N", 2: (47.0, 3.0, 2.0)}
    Image.new("RGB", SIZE).save(scene[0] / "images" / NAMES[0], exif=exif)
    with caplog.at_level("INFO"):
        captures.detected(scene[0]).scene(scene[0])
    assert "places (GPS) are not read" in caplog.text


def test_panoramas_are_refused_before_colmap_runs(scene):
    for i, name in enumerate(NAMES):
        captures.detected(scene[0]).scene(scene[0])
        path = scene[0] / "images" / name
        path.write_bytes(path.read_bytes() + b"<x Type='equirectangular'/>" * (i != 1))
    with pytest.raises(ValueError, match=r"IMG 1.JPG: EQUIRECT.*cube faces"):
        captures.detected(scene[0]).scene(scene[0])


def trajectory(folder, poses, rng, *, table, lens):
    """TUM's files; photos are called by their times, or named in rgb.txt."""
    rows, listed = ["# timestamp tx ty tz qx qy qz qw"], ["# timestamp filename"]
    for i, (name, pose) in enumerate(poses.items()):
        time = 1305031102.175304 + i / 30
        late = time + rng.uniform(-0.015, 0.015)
        turn = app_cases.quaternion(pose[:, :3])
        numbers = (late, *pose[:, 3], *map(float, turn))
        rows.append(" ".join(f"{number:.9f}" for number in numbers))
        rows.append(" ".join(f"{n:.9f}" for n in (late + 0.1, 9, 9, 9, 0, 0, 0, 1)))
        photo = f"rgb/{name if table else f'{time:.6f}.png'}"
        app_cases.write_photo(folder / photo, size=SIZE)
        app_cases.write_photo(folder / f"depth/{time:.6f}.png", size=SIZE)
        listed.append(f"{time:.6f} {photo}")
    path = folder / "groundtruth.txt"
    path.write_text("\n".join(rows))
    if table:
        (folder / "rgb.txt").write_text("\n".join(listed))
    cx, cy = np.array(SIZE) / 2 + CENTRE_PX
    values = [FOCAL_PX, FOCAL_PX, cx, cy, *K[:2], *P, K[2]][:lens]
    (folder / "calibration.txt").write_text(" ".join(map(str, values)))
    return path


@pytest.mark.parametrize("table", [False, True])
@pytest.mark.parametrize("lens", [4, 9])
def test_tum(tmp_path, rng, table, lens):
    poses = dict(zip(NAMES[1:], app_cases.camtoworlds(rng, 3), strict=True))
    path = trajectory(tmp_path, poses, rng, table=table, lens=lens)
    given = reading.cameras_of(path).shots
    own = dict(zip([Path(one.name).name for one in given], poses.values(), strict=True))
    check(path, own, brown if lens > 4 else lambda x, y: (x, y), names=[*own])
    assert captures.detected(tmp_path).name == "exported"
    assert len(reading.views_of(tmp_path)[0].names) == len(poses)
    assert len(camera_files.read(path).shots) == len(poses)
    assert path in camera_files.files_of(tmp_path)
    (tmp_path / "calibration.txt").unlink()
    with pytest.raises(ValueError, match=r"truth\.txt: .*calibration\.txt with `fx fy"):
        reading.views_of(tmp_path)


def test_a_pose_of_another_time_is_none(tmp_path, rng):
    poses = dict(zip(NAMES[1:], app_cases.camtoworlds(rng, 3), strict=True))
    path = trajectory(tmp_path, poses, rng, table=True, lens=4)
    rows = path.read_text().splitlines()
    path.write_text("\n".join(rows[3:]))
    assert len(reading.cameras_of(path).shots) == 2
    path.write_text("\n".join(rows[2::2]))
    with pytest.raises(ValueError, match=r"no pose within 0\.02 s"):
        reading.cameras_of(path)
    (tmp_path / "rgb.txt").write_text("1 rgb/a.png\n1 rgb/a.png\n2 rgb/a.png")
    with pytest.raises(ValueError, match=r"rgb\.txt: line 3: a second time of rgb/a"):
        reading.cameras_of(path)


def nerfies(folder, poses):
    for name, pose in poses.items():
        content = {
            "orientation": pose[:, :3].T.tolist(),
            "position": pose[:, 3].tolist(),
            "focal_length": FOCAL_PX,
            "pixel_aspect_ratio": 1.0,
            "skew": 0.0,
            "principal_point": (np.array(SIZE) / 2 + CENTRE_PX).tolist(),
            "radial_distortion": K,
            "tangential_distortion": P,
            "image_size": SIZE,
        }
        app_cases.write_json(folder / f"camera/{Path(name).stem}.json", content)
        for times in (1, 2):
            size = WIDTH // times, HEIGHT // times
            app_cases.write_photo(folder / f"rgb/{times}x/{name}", size=size)
    app_cases.write_json(folder / "metadata.json", {"000000": {"warp_id": 0}})
    path = folder / "dataset.json"
    app_cases.write_json(path, {"ids": [Path(name).stem for name in poses]})
    return path


def test_nerfies(tmp_path, rng):
    names = [f"{i:06d}.png" for i in range(3)]
    poses = dict(zip(names, app_cases.camtoworlds(rng, 3), strict=True))
    check(nerfies(tmp_path, poses), poses, brown, names=names)
    assert captures.detected(tmp_path).name == "exported"
    views, left_out = reading.views_of(tmp_path)
    assert (len(views.names), left_out) == (3, [])
    app_cases.write_json(tmp_path / "camera/000001.json", {"position": [0, 0, 0]})
    with pytest.raises(ValueError, match=r"camera/000001\.json: .*no focal_length"):
        reading.cameras_of(tmp_path / "dataset.json")


def test_a_folder_of_scenes_is_none_itself(tmp_path, scene):
    folder = tmp_path / "all" / "one"
    app_cases.write_photo(folder / "images" / "a.jpg", size=SIZE)
    (folder / "cameras.xml").write_text(xml(scene[1], METASHAPE))
    assert reading.find(folder) == folder / "cameras.xml"
    assert reading.find(folder.parent) is None
