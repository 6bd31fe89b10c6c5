"""Whatever a verdict.json or a poses.json holds, it is read, or named in one line."""

import json
import random
from types import SimpleNamespace

import pytest

from alignerf import export, facts
from alignerf.api import diagnosis
from alignerf.experiment import targets
from alignerf.exports import readme
from alignerf.page import told
from alignerf.scenes import prepared
from alignerf.verdict import __main__ as verdict
from alignerf.verdict import evidence
from tests.alignerf.causes import cases
from tests.damaged_cases import GONE, VALUES, changed, places

CASES = 300


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """The folder of a scene's results."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "results" / diagnosis.NAME
    (folder / "tables").mkdir(parents=True)
    (folder / "index.html").write_text("<html>")
    (folder / "tables/views.csv").write_text("view,split,psnr_db\na,train,20\n")
    return folder


def verdicts():
    """One of ours that has tried something, and one of another program's renders."""
    photos = {"camera": ("a", "b")}
    tried = cases.with_faults("camera", tried=(cases.GAIN,), photos=photos)
    ours = verdict.content_of(tried, [])
    theirs = verdict.content_of(cases.THEIRS._replace(matches=cases.MATCHES), [])
    return [json.loads(json.dumps(verdict.plain(one))) for one in (ours, theirs)]


def read_verdict(folder):
    """As all do that read one."""
    path, work = folder / "verdict.json", folder.parents[1]
    yield lambda: told.summary("a", told.read(folder), [], None)
    yield lambda: targets.verdicts([folder.name], export="x", results=folder.parent)
    yield lambda: targets.of_judged(folder.name)
    yield lambda: evidence.read_before(path, 1000.0)
    yield lambda: export.pays(path, "aligned")
    yield lambda: diagnosis.report_of(work, {}, cores=None)


POSES = """{
"registered": 8, "total": 9, "left_out": ["a"],
"mean_reprojection_error_px": 0.5, "photo_size": [160, 120], "source": "photos",
"width": 80, "height": 60, "photo_width": 160, "photo_height": 120, "downscale": 2,
"perturb_px": 1.5, "perturb_by": "rotation", "poses": "adjusted", "photos_alone": "p",
"external_renders": {"depth": "far", "cameras": "t", "layout": "l", "way": "taken"},
"camera_check": {
    "adjustment": {
        "accepted": true, "before_px": 2.4, "after_px": 0.2, "worst_px": 8.4,
        "pose_error_px": 2.9, "again": {"accepted": true}
    },
    "lens": {
        "given": {
            "changed": ["focal"], "focal_ratio": 1.1, "centre_px": 0, "shutter_px": 0,
            "distortion_px": 0, "before_px": 2.4, "after_px": 0.2
        }
    }
}
}"""


def read_poses(folder):
    args = SimpleNamespace(scene=folder, cameras=None, if_pays=("a", "b"))
    chosen = SimpleNamespace(adjusted=True, corrected=True)

    def judged():
        poses = prepared.read_poses(folder, evidence.POSES)
        evidence.by_colmap(poses, folder)
        return evidence.of_matches(poses), evidence.read_judged(poses)

    def written():
        poses = prepared.read_poses(folder, prepared.MORE)
        names = readme.of_left_out(poses.get("left_out") or [])
        return names, readme.of_cameras(args, chosen, poses, paid=True)

    yield from (judged, written)
    yield lambda: facts.photo_facts(folder)
    yield lambda: (export.is_accepted(folder), export.is_synthetic(folder))


@pytest.mark.parametrize(
    ("name", "contents", "readers"),
    [
        ("verdict.json", verdicts(), read_verdict),
        ("poses.json", [json.loads(POSES)], read_poses),
    ],
)
def test_a_damaged_file_is_read_or_named(scene, name, contents, readers):
    damages = [
        (content, at, value)
        for content in contents
        for at in places(content)
        for value in VALUES
        if at or value is not GONE
    ]
    for content in contents:
        (scene / name).write_text(json.dumps(content))
        for read in readers(scene):
            read()
    for content, at, value in random.Random(0).sample(
        damages, min(CASES, len(damages))
    ):
        (scene / name).write_text(json.dumps(changed(content, at, value)))
        said = [fault for read in readers(scene) if (fault := fault_of(read))]
        assert all(name in fault and "\n" not in fault for fault in said), (at, value)


def fault_of(read):
    """What it says of bad input; None where it reads it."""
    try:
        read()
    except ValueError as error:
        return str(error)
    return None
