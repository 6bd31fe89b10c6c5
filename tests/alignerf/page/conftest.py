"""A scene's results, small and made up, as the stages leave them for the page."""

import json

import numpy as np
import pandas as pd
import pytest

from alignerf.files import images
from alignerf.page import __main__ as page
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
    write_json(
        folder / "verdict.json",
        {
            "headline": "Aligned.",
            "because": ["A < B & C."],
            "do_first": {"text": "Nothing.", "command": None},
            "tried": [],
            "measured": [],
            "causes": [],
            "state": "aligned",
            "evidence": {"overfit_px": None},
        },
    )
    poses = {"registered": 5, "total": 6, "test_views": 3, "width": WIDTH}
    poses |= {"height": HEIGHT, "photo_width": 72, "photo_height": 48}
    write_json(folder / "poses.json", poses | {"mean_reprojection_error_px": None})
    write_json(folder / "facts.json", {})
    decided = {"key": "model.near", "default": 0.2, "value": 0.4, "reason": "near"}
    write_json(folder / "decisions.json", {"decisions": [decided | {"facts": {}}]})
    models, training = "{base: {decided: [near]}}", "{decided: []}"
    text = f"models: {models}\ntraining: {training}\n"
    (folder / "config.yaml").write_text(text)
    write_tables(folder / "tables")
    return folder


@pytest.fixture
def render(results):
    """() -> the page's HTML, of the results as they are then."""

    def make():
        rounds = [
            (
                results / f"base/round{k}/renders/test",
                results / f"base/round{k}/flow/test",
            )
            for k in (0, 1)
        ]
        return page.render(results, rounds=rounds, base=results / "base/round0")

    return make
