"""flow.overfit: what an estimator invents between images that are displaced nowhere."""

import csv

import cv2
import numpy as np
import pytest

from alignerf.files import images
from flow import overfit
from flow.estimation import pairs
from flow.warping import files

SHIFT_PX = 2


@pytest.fixture
def folders(tmp_path):
    """Renders, and photos that are shifted against them by SHIFT_PX, of 11 views."""
    rng = np.random.default_rng(0)
    for number in range(overfit.MOST_VIEWS + 3):
        noise = sum(
            scale * cv2.GaussianBlur(rng.normal(size=(70, 90, 3)), (0, 0), scale)
            for scale in (1, 3, 8)
        )
        large = np.clip(127 + 45 * noise / noise.std(), 0, 255).astype(np.uint8)
        render, photo = large[5:65, 5:85], large[5:65, 5 + SHIFT_PX : 85 + SHIFT_PX]
        name = f"v{number:02d}"
        images.write(tmp_path / "renders" / f"{name}.png", render)
        images.write(tmp_path / "photos" / f"{name}.png", photo)
        flow_px, valid, _ = pairs.flow_and_validity(render, photo)
        files.write_flow(tmp_path / "flow" / f"{name}.npz", flow_px, valid)
    return [tmp_path / name for name in ("renders", "photos", "flow", "out.csv")]


def test_it_is_small_where_photos_are_shifted_by_pixels(folders):
    rows = overfit.main(*folders, threads=2)
    with open(folders[-1], newline="") as file:
        written = list(csv.DictReader(file))
    views = [row["view"] for row in written]
    assert views == [row["view"] for row in rows]
    assert len(views) == overfit.MOST_VIEWS
    # From the first view to the last.
    assert (views[0], views[-1]) == ("v00", "v10")
    assert all(float(row["median_px"]) < 0.25 for row in written)


def test_a_fault_names_its_view_and_leaves_no_table(folders):
    renders, _, flow, out = folders
    flow_px, valid = files.read_flow(flow / "v00.npz")
    files.write_flow(flow / "v00.npz", flow_px[:-9], valid[:-9])
    with pytest.raises(ValueError, match="v00"):
        overfit.main(*folders)
    assert not out.exists()
    (renders / "v05.png").unlink()
    (folders[1] / "v03.png").unlink()
    with pytest.raises(ValueError, match=r"v03\.png: no photo"):
        overfit.main(*folders)


def test_one_view_is_enough(folders):
    for path in sorted(folders[0].iterdir())[1:]:
        path.unlink()
    (row,) = overfit.main(*folders)
    assert row["view"] == "v00"
