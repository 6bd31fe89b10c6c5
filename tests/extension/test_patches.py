"""One new file adds what it registers, everywhere where others stand."""

import json

import pytest

SOFT = """
import json, pathlib, alignerf
from alignerf.page import told as page
from alignerf.verdict import __main__ as verdict
from tests.alignerf.causes import cases

told = {}
for name, e in ("ours", cases.WELL), ("theirs", cases.THEIRS):
    for soft in (0.8, 0.5, 0.3):
        content = verdict.content_of(e._replace(detail_median=soft), [])
        pathlib.Path("verdict.json").write_text(json.dumps(verdict.plain(content)))
        told[f"{name} {soft}"] = page.read(pathlib.Path())
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def soft(patched):
    """Verdicts of a cause that is looked for besides."""
    return json.loads(patched("cause.patch")(SOFT))


@pytest.mark.parametrize("e", ["ours", "theirs"])
def test_a_cause_is_named_said_advised_on_and_shown(soft, e):
    levels = {"0.8": "ok", "0.5": "likely", "0.3": "faulty"}
    for value, level in levels.items():
        found = soft[f"{e} {value}"]
        gauge = next(one for one in found["gauges"] if one["cause"] == "soft")
        assert (gauge["name"], gauge["level"]) == ("detail of all photos", level)
        # More is better.
        assert (gauge["share"] > 1) == (level != "ok")
        assert ("soft" in found["headline"]) == (level != "ok")
        assert found["state"] == "aligned"
        if level == "ok":
            assert not found["findings"]
            continue
        (finding,) = found["findings"]
        wanted = {"cause": "soft", "value": float(value), "sure": level == "faulty"}
        assert finding == wanted | {"at_stake_db": None, "photos": []}
        assert f"{float(value):.2f} of their renders' detail" in found["because"][0]
        words = "enlarged" if e == "ours" else "as they were taken"
        assert words in found["do_first"]["text"]


RAIL = """
import json, pathlib
import cv2, numpy as np
from alignerf import config, export, poses
from alignerf.experiment import check, plan
from alignerf.scenes import prepared
from alignerf.cli import folders

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
experiment = plan.Experiment(check.checked({"scenes": {"my_rail": scene}}))
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


EVERY = """
import yaml
from alignerf import methods
from tests.alignerf.methods import test_every_method as every

(record,) = (one for one in methods.every() if one.key == "goes_on")
demo = yaml.safe_load(open("tests/config.yaml"))
experiment = every.experiment_with(demo, record)
every.check_keys(record)
for name in ("label", "moves", "test_set", "tables", "cost", "part"):
    getattr(every, f"check_{name}")(experiment)
"""


LOSS = """
import pathlib
from alignerf import config
from alignerf.methods import base, toy_loss

pathlib.Path("mine.yaml").write_text(
    "scenes: {a: {source: courtyard}}\\n"
    "methods: {plain: {}, mine: {trimmed: {share: 0.9}}}\\n"
)
for loss in (
    toy_loss.Part.data_loss,
    lambda self, rendering, photo, weight: rendering.rgb,
    lambda self, rendering, photo, weight: (rendering.values - photo) ** 2,
):
    toy_loss.Part.data_loss = loss
    base.part_of.cache_clear()
    try:
        config.main(["--check", "mine.yaml"])
        print("right")
    except ValueError as error:
        print(error)
"""


def test_what_holds_for_every_method_holds_for_one_more(patched):
    patched("toy_method.py")(EVERY)


def test_a_loss_is_traced_before_anything_runs(patched):
    *_, right, unknown, unsummed = patched("toy_loss.py")(LOSS).splitlines()
    assert right == "right"
    where = "mine.yaml: methods.mine: its loss: "
    assert (
        unknown == f"{where}AttributeError: 'Rendering' object has no attribute 'rgb'"
    )
    assert unsummed.startswith(f"{where}TypeError: ")
