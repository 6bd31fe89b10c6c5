"""`alignerf.diagnose`: arrays or files in, what is wrong out."""

import os
import re
import sys
import tempfile

import cv2
import numpy as np
import pytest

import alignerf
from alignerf.api import diagnosis
from alignerf.page import __main__ as page
from tests import judged_cases as cases

N = 6
K = cases.CAMTOPIX


@pytest.fixture(scope="module")
def images():
    """A render lies a pixel beside its photo, and is a little blurred."""
    taken = [cases.picture(i) for i in range(N)]
    return np.stack(taken)


@pytest.fixture(scope="module")
def renders(images):
    return [np.roll(cv2.GaussianBlur(one, (0, 0), 1), 1, axis=1) for one in images]


@pytest.fixture(scope="module")
def cameras(rng_of_cameras):
    turns = [cv2.Rodrigues(v)[0] for v in rng_of_cameras.normal(0, 0.05, (N, 3))]
    poses = np.tile(np.eye(4), (N, 1, 1))
    poses[:, :3, :3] = turns
    poses[:, 0, 3] = np.arange(N) / 5
    return poses


@pytest.fixture(scope="module")
def rng_of_cameras():
    return np.random.default_rng(3)


@pytest.fixture(scope="module")
def report(images, renders, cameras):
    return alignerf.diagnose(
        images, renders, {"K": K, "camera_to_world": cameras}, held_out=[0]
    )


@pytest.mark.whole
def test_it_says_what_the_command_says(report, tmp_path):
    assert report.state in ("aligned", "misaligned", "unclear")
    assert str(report).startswith("VERDICT ")
    found = {cause.name: cause for cause in report.causes}
    shifted = found["lens_shift"]
    assert (shifted.level, shifted.unit) == ("faulty", "px")
    assert shifted.value == pytest.approx(1, abs=0.1)
    assert shifted.sentence.startswith("All photos are misaligned alike")
    assert list(report.views.split) == ["train"] * (N - 1) + ["test"]
    report.save(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    assert "<html" in text
    assert 'href="verdict.json"' not in text


def test_cameras_that_are_right_come_back(report, cameras):
    assert not report.corrected
    np.testing.assert_allclose(report.cameras["camera_to_world"], cameras, atol=1e-12)
    np.testing.assert_allclose(report.cameras["K"], np.broadcast_to(K, (N, 3, 3)))
    assert report.cameras["names"][0] == "view0000"


def test_a_report_points_at_no_folder_that_is_gone():
    """What a command writes is in the report, or takes a judgement of files."""
    folded = "Train again: the\n             command below writes them.\n"
    command = f"    {diagnosis.EXPORT}\n"
    told = diagnosis.told(folded + command, corrected=True)
    assert told == "Train again: they are in report.cameras.\n"
    told = diagnosis.told(f"Mask it (the command below writes masks).\n{command}")
    assert told == "Mask it (an export of `why-blurry judge` writes masks).\n"
    told = diagnosis.told("By matches, poses are off: an export\n corrects them.")
    assert "export" in told
    assert diagnosis.told("given with DEPTH=folder.") == "given with depth=."
    poses_are = diagnosis.told("poses: an export\n corrects them.", corrected=True)
    assert poses_are == "poses: they are in report.cameras."
    environment = page.template().environment
    made = environment.get_template("verdict.html").render(
        parts=environment.get_template("parts.html").module,
        verdict={
            "do_first": {"text": "", "command": diagnosis.EXPORT},
            "because": [],
            "about": [],
            "fixes": None,
        },
        export_command=f"{diagnosis.EXPORT} ",
        trainers={"Brush": "brush ."},
        summary=f"Mask\n    {diagnosis.EXPORT}\nFor other programs: {diagnosis.EXPORT}",
    )
    for corrected in (False, True):
        told = diagnosis.told(made, corrected=corrected)
        assert "Copy a summary" in told
        assert not re.search("export|brush|For other|class=.command", told)


def test_nothing_of_the_caller_changes(report, tmp_path, monkeypatch):
    """Nor is anything left, in its folder or the temporary one."""
    photos = cases.photos(tmp_path / "photos")
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "work"))
    before = dict(os.environ), sys.argv, os.getcwd()
    with pytest.raises(ValueError, match="gone does not exist"):
        alignerf.diagnose(photos, tmp_path / "gone")
    assert (dict(os.environ), sys.argv, os.getcwd()) == before
    assert not os.listdir()


def test_world_to_camera_is_the_inverse(cameras):
    names, sizes = [f"v{i}" for i in range(N)], [cases.SIZE] * N
    ways = {"camera_to_world": cameras, "world_to_camera": np.linalg.inv(cameras)}
    made = [
        diagnosis.transforms_of({"K": np.tile(K, (N, 1, 1)), way: poses}, names, sizes)
        for way, poses in ways.items()
    ]
    poses = [[f["transform_matrix"] for f in one["frames"]] for one in made]
    np.testing.assert_allclose(*poses, atol=1e-12)
    # A transforms.json has OpenGL's axes: the camera looks along -z.
    np.testing.assert_allclose(poses[0][0] @ np.diag([1, -1, -1, 1]), cameras[0])


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"renders": np.zeros((N, 8, 8, 3), np.float32)}, r"renders\[0\]: float32"),
        ({"renders": np.zeros((2, 8, 8, 3), np.uint8)}, "renders: 2 of 6 images"),
        ({"renders": "folder"}, "renders: arrays were expected"),
        ({"cameras": "sparse/0"}, "cameras: a mapping was expected"),
        ({"cameras": {"K": K}}, "camera_to_world or world_to_camera"),
        ({"cameras": {"K": K, "world_to_camera": K}}, r"\[3, 3\] instead of \[6, 3"),
        ({"held_out": [6]}, "there is no view 6"),
    ],
)
def test_what_cannot_be_judged_is_one_line(images, renders, changes, says):
    given = {"renders": renders} | changes
    with pytest.raises(ValueError, match=says):
        alignerf.diagnose(images, **given)


IMAGES = np.zeros((3, 40, 40, 3), np.uint8)
POSES = np.tile(np.eye(4), (3, 1, 1))
LENS = np.array([[50.0, 0, 20], [0, 50, 20], [0, 0, 1]])


class OfBytes:
    def __fspath__(self):
        return b"nowhere"


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"images": None}, "images: arrays or folders were expected"),
        ({"images": []}, "images: none were given"),
        ({"renders": 5}, "renders: arrays or folders"),
        ({"renders": IMAGES[:2]}, "renders: 2 of 3 images"),
        ({"images": np.array(5)}, "images: arrays or folders"),
        ({"renders": {0: IMAGES[0]}}, "renders: arrays or folders"),
        ({"renders": (one for one in IMAGES[:2])}, "renders: 2 of 3 images"),
        ({"images": [[1, [2, 3]]] * 3}, r"images\[0\]: object \[0\] instead of"),
        ({"depth": 5}, "depth: arrays or folders"),
        ({"depth": np.array(5)}, "depth: arrays or folders"),
        ({"depth": (one for one in [1])}, "depth: 1 of 3 images"),
        ({"depth": np.ones((3, 4, 4), complex)}, "depth of view0000: numbers"),
        ({"cameras": {"K": LENS + 0j, "camera_to_world": POSES}}, "cameras.K: an"),
        (
            {"cameras": {"K": LENS, "camera_to_world": 1j * POSES}},
            "camera_to_world: an",
        ),
        ({"cameras": {"K": [[1, 2], [3]], "camera_to_world": POSES}}, "cameras.K: an"),
        ({"cores": 0}, "cores: a whole number from 1"),
        ({"cores": "2"}, "cores: a whole number from 1"),
        ({"cores": True}, "cores: a whole number from 1"),
        ({"images": "~nouser/x", "renders": "y"}, "~nouser/x does not exist"),
        ({"images": OfBytes(), "renders": "y"}, "nowhere does not exist"),
        ({"images": IMAGES[:, :0]}, r"images\[0\]: uint8 \[0, 40, 3\] instead"),
        ({"held_out": [True, False, False]}, "held_out: indices"),
        ({"held_out": 3}, "held_out: indices"),
        ({"held_out": [7]}, "held_out: there is no view 7"),
        ({"depth": ["a"] * 3}, "depth of view0000: numbers"),
        (
            {"cameras": {"K": LENS, "camera_to_world": "x"}},
            "cameras.camera_to_world: an",
        ),
        ({"cameras": {"K": LENS * np.nan, "camera_to_world": POSES}}, "cameras.K: an"),
        (
            {"cameras": {"K": LENS + [[0, 5, 0]] * 3, "camera_to_world": POSES}},
            "no skew",
        ),
        ({"cameras": {"K": LENS, "world_to_camera": 0 * POSES}}, "no rotation in it"),
        ({"images": "photos", "held_out": np.arange(2)}, "held_out: of arrays"),
    ],
)
def test_input_that_is_none_is_one_line(changes, says):
    given = {"images": IMAGES, "renders": IMAGES} | changes
    with pytest.raises(ValueError, match=says) as found:
        alignerf.diagnose(**given)
    assert "\n" not in str(found.value)
