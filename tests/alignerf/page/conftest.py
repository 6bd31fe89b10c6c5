"""A scene's results, small and made up, as the stages leave them for the page."""

import json

import numpy as np
import pandas as pd
import pytest

from alignerf.io import images
from alignerf.page import __main__ as page
from alignerf.scenes import cameras
from alignerf.verdict import views

HEIGHT, WIDTH = 24, 36
TEST = ["01", "<b>&'02", "03"]
TRAIN = ["04", "05"]
REASON = "blurred <script>alert(1)</script>"


def write_json(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))


def write_images(folder, names, rng):
    for name in names:
        image = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        images.write(folder / f"{name}.png", image)


def write_flows(folder, names, length_px):
    folder.mkdir(parents=True)
    flow_px = np.full((HEIGHT, WIDTH, 2), length_px, np.float32)
    for name in names:
        valid = np.ones((HEIGHT, WIDTH), bool)
        np.savez(folder / f"{name}.npz", flow_px=flow_px, valid=valid)


def write_cameras(path, names, *, size=(WIDTH, HEIGHT), shift=0.0, corner=(0, 0)):
    """Cameras on an arc around the origin; those of TRAIN moved along by `shift`."""
    poses = []
    for i, name in enumerate(names):
        angle = 0.4 * i
        back = np.array([np.sin(angle), 0.0, np.cos(angle)])
        right, up = np.cross([0.0, 1.0, 0.0], back), np.array([0.0, 1.0, 0.0])
        moved = shift * right * (name.partition("_w")[0] in TRAIN)
        poses.append(np.stack([right, up, back, 3 * back + moved], axis=1))
    middle = np.eye(3)
    middle[:2, 2] = corner
    np.savez(
        path,
        pixtocams=np.stack(
            [cameras.intrinsics(30.0, WIDTH, HEIGHT) @ middle] * len(names)
        ),
        camtoworlds=np.stack(poses),
        names=np.array(names),
        width=size[0],
        height=size[1],
        split=np.array(
            ["test" if n.partition("_w")[0] in TEST else "train" for n in names]
        ),
    )


def write_crops(folder, rng, *, corner):
    """A scene of crops of two photos, with the renders of a training."""
    names = ["01_w0", "05_w0", "05_w1"]
    for kind in ("images", "base/round0/renders/test", "base/round0/renders/train"):
        split = kind.rpartition("/")[2]
        own = [
            n
            for n in names
            if split == "images" or (n[:2] in TEST) == (split == "test")
        ]
        for name in own:
            image = rng.integers(0, 256, (8, 8, 3), dtype=np.uint8)
            images.write(folder / kind / f"{name}.png", image)
    write_cameras(folder / "cameras.npz", names, size=(8, 8), corner=corner)
    return folder / "base/round0"


def view_row(name, split, flow_px):
    numbers = dict.fromkeys(views.COLUMNS, 0.5) | {"flow_px": flow_px}
    why = REASON if flow_px > 2 else ""
    return numbers | {"view": name, "split": split, "stands_out": why}


def write_tables(folder):
    folder.mkdir(parents=True)
    lengths = {**dict.fromkeys(TEST, 0.5), "03": 3.0, "04": 0.1, "05": 9.0}
    rows = [
        view_row(name, "test" if name in TEST else "train", px)
        for name, px in lengths.items()
    ]
    pd.DataFrame(rows).to_csv(folder / "views.csv", index=False)
    row = {"method": "base", "warping": "none", "test_set": "standard"}
    row |= {"psnr_db": 20.0, "difference_db": 0.0, "total_time_s": 90, "source": ""}
    row |= {"difference_low_db": 0.0, "difference_high_db": 0.0, "params": 1000}
    rows = [row, row | {"warping": "once", "psnr_db": 9.5, "difference_db": np.nan}]
    pd.DataFrame(rows).to_csv(folder / "misalignment.csv", index=False)


@pytest.fixture
def results(tmp_path, rng):
    """The folder of a scene."""
    folder = tmp_path / "results" / "my scene"
    write_images(folder / "images", [*TEST, *TRAIN], rng)
    base = folder / "base/round0"
    for split, names in (("test", TEST), ("train", TRAIN)):
        for kind in ("renders", "warped"):
            write_images(base / kind / split, names, rng)
        write_flows(base / "flow" / split, names, 0.1)
    write_images(folder / "base/round1/renders/test", TEST, rng)
    write_flows(folder / "base/round1/flow/test", TEST, 5.0)
    soft = base / "renders/test/03.png"
    images.write(soft, images.read(soft) // 4 + 96)
    write_json(
        folder / "verdict.json",
        {
            "verdict": ["VERDICT   Aligned."],
            "headline": "Aligned.",
            "because": ["A < B & C."],
            "do_first": {"text": "Nothing.", "command": None},
            "tried": [],
            "measured": [],
            "causes": [],
            "state": "aligned",
            "evidence": {"overfit_px": None, "pairs": {"stops": False}},
        },
    )
    poses = {"registered": 5, "total": 6, "test_views": 3, "width": WIDTH}
    poses |= {"height": HEIGHT, "photo_width": 72, "photo_height": 48}
    write_json(folder / "poses.json", poses | {"mean_reprojection_error_px": None})
    write_cameras(folder / "cameras.npz", [*TEST, *TRAIN])
    write_cameras(folder / "moved.npz", [*TEST, *TRAIN], shift=0.01)
    points = rng.normal(size=(30, 3))
    colours = rng.integers(0, 256, (30, 3), dtype=np.uint8)
    np.savez(folder / "images/points.npz", points=points, colours=colours)
    write_json(folder / "facts.json", {})
    decided = {"key": "model.near", "default": 0.2, "value": 0.4, "reason": "near"}
    write_json(folder / "decisions.json", {"decisions": [decided | {"facts": {}}]})
    training = "{steps: 9, budget_min: null}"
    text = f"models: {{base: {{near: null}}}}\ntraining: {training}\n"
    (folder / "config.yaml").write_text(text)
    write_tables(folder / "tables")
    return folder


@pytest.fixture
def crops(results, rng):
    """Crops by the cameras as given and as corrected, and by which method."""
    scenes = [results.parent / f"crops{after}" for after in ("", "_after")]
    made = [
        write_crops(scene, rng, corner=corner)
        for scene, corner in zip(scenes, ((10, 4), (12, 3)), strict=True)
    ]
    return (*map(str, made), "aligned")


@pytest.fixture
def render(results):
    """(options of `page.render`) -> the page's HTML, of the results as they are."""

    def make(**options):
        rounds = [
            (
                results / f"base/round{k}/renders/test",
                results / f"base/round{k}/flow/test",
            )
            for k in (0, 1)
        ]
        base = results / "base/round0"
        return page.render(results, rounds=rounds, base=base, **options)

    return make


@pytest.fixture
def causes(results):
    """The verdict as newer runs write it, with a command and every cause."""
    path = results / "verdict.json"
    told = json.loads(path.read_text())
    told |= {
        "headline": "Misaligned by 2.3 px: poses are off.",
        "state": "misaligned",
        "do_first": {
            "text": "Correct the cameras: `make photos <x>`.",
            "command": "make photos <x>",
        },
        "tried": [
            fix("aligned", 1.2, pays=True, matches="2.66 -> 0.50 px"),
            fix("warped", -0.4, notes=["no <gain>"]),
        ],
        "measured": ["Photo and render are 2.3 px apart."],
        "causes": [
            cause("camera", "faulty", 2.2, 0.4, "px"),
            cause("exposure", "ok", 0.03, 0.06, "stops"),
            cause("undertrained", "ok", 4.0, 0.5, "epochs", more_is_better=True),
            cause("copies", "ok", 0.0, 0.0, "photos"),
            cause("lens_shift", "cannot tell", None, 0.08, "px"),
        ],
    }
    path.write_text(json.dumps(told))
    return told


def cause(name, level, value, limit, unit, more_is_better=False):
    """A cause as a verdict tells it."""
    note = "not measured" if value is None else ""
    told = {"cause": name, "name": f"{name}'s name", "level": level, "unit": unit}
    told |= {"value": value, "limit": limit, "more_is_better": more_is_better}
    told |= {"measured": f"{value} {unit}", "allowed": f"up to {limit}", "note": note}
    told["page"] = "howto/fix.md#poses-are-off"
    return told | {"text": f"{name}'s name ({value} {unit})"}


def fix(name, db, *, pays=False, notes=(), matches=""):
    """A fix that was tried, as a verdict tells it."""
    told = {"name": name, "method": name, "db": db, "low": db - 0.3, "high": db + 0.3}
    told |= {"pays": pays, "notes": [*notes], "matches": matches, "seconds": 40}
    told |= {"in_headline": bool(matches)}
    return told | {"test_set": "oracle", "text": f"{name}: {db:+.1f} dB"}
