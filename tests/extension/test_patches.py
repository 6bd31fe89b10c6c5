"""A patch of one new file adds what it registers, everywhere where others stand."""

import json

import pytest

SOFT = """
import json, pathlib, alignerf
from alignerf.experiment import sources
from alignerf.page import told as page
from alignerf.verdict import __main__ as verdict
from tests.alignerf.causes import cases

told = {}
for name, e in ("ours", cases.WELL), ("theirs", cases.THEIRS):
    for soft in (0.8, 0.5, 0.3):
        content = verdict.content_of(e._replace(detail_median=soft), [], [])
        pathlib.Path("verdict.json").write_text(json.dumps(verdict.plain(content)))
        told[f"{name} {soft}"] = page.read(pathlib.Path())
reached = {path.name for path in sources.reached("alignerf.verdict")}
print(json.dumps([told, "soft.py" in reached]))
"""


@pytest.fixture(scope="module")
def soft(patched):
    """Verdicts of a cause that is looked for besides."""
    return json.loads(patched("cause.patch")(SOFT))


@pytest.mark.parametrize("e", ["ours", "theirs"])
def test_a_cause_is_named_said_advised_on_and_shown(soft, e):
    told, reached = soft
    assert reached
    levels = {"0.8": "not seen", "0.5": "likely", "0.3": "sure"}
    for value, level in levels.items():
        found = told[f"{e} {value}"]
        gauge = found["gauges"][-1]
        assert (gauge["name"], gauge["level"]) == ("detail of all photos", level)
        # More is better.
        assert (gauge["filled"] > 0.5) == (level != "not seen")
        assert ("soft" in found["headline"]) == (level != "not seen")
        assert found["state"] == "aligned"
        if level == "not seen":
            assert not found["findings"]
            continue
        (finding,) = found["findings"]
        wanted = {"cause": "soft", "size": float(value), "sure": level == "sure"}
        assert finding == wanted
        assert f"{float(value):.2f} of their renders' detail" in found["because"][0]
        words = "enlarged" if e == "ours" else "as they were taken"
        assert words in found["do_first"]["text"]


RAIL = """
import json, pathlib
import cv2, numpy as np
from alignerf import config, export, poses
from alignerf.experiment import check, plan, sources
from alignerf.scenes import prepared
from alignerf.start import folders

folder = pathlib.Path("my_rail")
folder.mkdir()
(folder / "rail.json").write_text(json.dumps({"lens": [60.0, 60.0, 32.0, 24.0]}))
for i in range(8):
    photo = np.random.default_rng(i).integers(0, 255, (48, 64, 3), np.uint8)
    cv2.imwrite(str(folder / f"v{i}.png"), photo)
found = folders.scenes_of(folder)
faults = []
for change in {"step_m": 20.0}, {"step": 1}:
    try:
        scene = found["my_rail"] | {"rail": change}
        check.checked({"scenes": {"my_rail": scene}})
    except ValueError as error:
        faults.append(str(error))
scene = found["my_rail"] | {"rail": {"step_m": 0.5}, "triangulate": False}
experiment = plan.Experiment(check.checked({"scenes": {"my_rail": scene}}), None)
slice_of = plan.scene_config(experiment, "my_rail")
out = pathlib.Path("results/my_rail")
poses.main(json.loads(slice_of), out)
export.main(["--scene", str(out), "--config", slice_of, "--out", "exported"])
sides = prepared.load(out)
step = np.diff(prepared.read_cameras(out / "cameras.npz")["camtoworlds"][:, 0, 3])
print(json.dumps({
    "found": found,
    "faults": faults,
    "schema": "Rail" in config.schema_text(),
    "names": sides.names,
    "step": step.tolist(),
    "files": sorted(path.name for path in pathlib.Path("exported").iterdir()),
    "reached": {
        stage: "rail.py" in {path.name for path in sources.reached(f"alignerf.{stage}")}
        for stage in ("poses", "export", "train")
    },
}))
"""


def test_a_source_is_detected_checked_prepared_and_exported(patched):
    told = json.loads(patched("capture.patch")(RAIL))
    assert told["found"] == {"my_rail": {"source": "rail", "path": "my_rail"}}
    assert told["faults"] == [
        "config: scenes.my_rail.rail.step_m: no rail is as long",
        "config: scenes.my_rail.rail: 'step' is no key of this section, perhaps "
        "'step_m'",
    ]
    assert told["schema"]
    assert told["names"] == [f"v{i}" for i in range(8)]
    assert told["step"] == pytest.approx([0.5] * 7)
    assert {"images", "sparse", "transforms.json", "README.txt"} <= {*told["files"]}
    assert told["reached"] == {"poses": True, "export": True, "train": False}
