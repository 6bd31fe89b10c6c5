"""flow.figures.crops: which crop it shows, and that it draws what there is."""

import cv2
import numpy as np
import pytest

from alignerf.io import faults, images
from flow.figures import crops
from flow.warping import files


def brute_force(photo):
    """The crop by its definition, every sum anew."""
    height, width = photo.shape[:2]
    side = min(max(1, round(width / 4)), height)
    grey = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY).astype(np.float64)
    energy = (grey - cv2.GaussianBlur(grey, (0, 0), crops.BLUR_SIGMA_PX)) ** 2
    sums = {
        (left, top): energy[top : top + side, left : left + side].sum()
        for top in range(height - side + 1)
        for left in range(width - side + 1)
    }
    return *max(sums, key=sums.get), side


@pytest.mark.parametrize(
    "size", [(40, 30), (30, 40), (41, 7), (400, 20), (5, 5), (4, 1), (1, 9), (1, 1)]
)
def test_the_crop_has_most_high_frequencies(rng, size):
    width, height = size
    for _ in range(5):
        photo = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
        # Smooth but for a part.
        smooth = cv2.GaussianBlur(photo, (0, 0), 3)
        keep = (
            rng.uniform(size=(height, width, 1)) ** 2
            * np.linspace(0, 1, width)[None, :, None]
        )
        photo = np.round(keep * photo + (1 - keep) * smooth).astype(np.uint8)
        crop = crops.choose_crop(photo)
        assert crop == brute_force(photo)
        assert crop.cut(photo).shape == (crop.side, crop.side, 3)


def test_detail_is_found_and_brightness_is_not():
    photo = np.zeros((90, 120, 3), np.uint8)
    photo[:, :60] = 250
    photo[50:60:2, 90:100:2] = 130
    left, top, side = crops.choose_crop(photo[:, 64:])
    assert left <= 26
    assert left + side >= 36
    assert top <= 50
    assert top + side >= 60


@pytest.mark.parametrize("level", [0, 200])
def test_without_detail_it_is_the_first_crop(level):
    photo = np.full((60, 80, 3), level, np.uint8)
    assert crops.choose_crop(photo) == (0, 0, 20)


def test_views_are_spread_evenly():
    names = [f"{i:02}" for i in range(9)]
    assert crops.choose_views(names) == ["00", "04", "08"]
    assert crops.choose_views(names[:3]) == names[:3]
    assert crops.choose_views(names[:2]) == names[:2]
    assert crops.choose_views(["a"]) == ["a"]


def test_psnr(rng):
    photo = rng.integers(0, 255, (8, 8, 3), dtype=np.uint8)
    assert crops.psnr_db(photo, photo) == np.inf
    off = crops.psnr_db(photo + np.uint8(1), photo)
    assert off == pytest.approx(20 * np.log10(255))
    other = rng.integers(0, 255, (8, 8, 3), dtype=np.uint8)
    mse = np.mean((other.astype(np.float64) - photo) ** 2)
    assert crops.psnr_db(other, photo) == 10 * np.log10(255**2 / mse)


def make_scene(folder, rng, *, size=(40, 30), views=("a", "b"), methods=2, known=0.9):
    """Photos, and renders and flows of each method, as the chain leaves them."""
    width, height = size
    entries = []
    for view in views:
        image = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
        images.write(folder / "photos" / f"{view}.png", image)
    for number in range(methods):
        place = folder / f"method_{number}"
        for view in views:
            image = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
            images.write(place / "renders" / f"{view}.png", image)
            flow_px = rng.normal(size=(height, width, 2)).astype(np.float32)
            valid = rng.uniform(size=(height, width)) < known
            files.write_flow(place / "flow" / f"{view}.npz", flow_px, valid)
        paths = {key: str(place / key) for key in ("renders", "flow")}
        entries.append({"method": place.name} | paths)
    return entries


def draw(folder, methods):
    """(exit code, width, height) of the figure; zeros where there is none."""
    figure = folder / "figures" / "crops.png"
    code = faults.exit_code(crops.draw_methods, folder / "photos", methods, figure)
    height, width = cv2.imread(str(figure)).shape[:2] if figure.exists() else (0, 0)
    return code, width, height


def test_a_row_for_each_view_and_columns_for_each_method(tmp_path, rng):
    views = ("a", "b c", "d$e$f")
    found = {
        (count, methods): draw(
            tmp_path / f"{count}{methods}",
            make_scene(
                tmp_path / f"{count}{methods}",
                rng,
                views=views[:count],
                methods=methods,
            ),
        )
        for count, methods in ((1, 2), (3, 2), (1, 4))
    }
    assert all(code == 0 for code, _, _ in found.values())
    # About a page's width for two methods.
    assert found[3, 2][1] == found[1, 2][1] == pytest.approx(7.1 * 150, abs=10)
    assert found[1, 4][1] > found[1, 2][1]
    assert found[3, 2][2] > 1.5 * found[1, 2][2]


@pytest.mark.parametrize(
    "options",
    [
        {"size": (300, 10)},
        {"size": (10, 200)},
        {"size": (1, 1), "views": ("one",), "methods": 1},
        {"known": 0.0},
        {"views": ("a_very_long_name" * 5,)},
    ],
    ids=str,
)
def test_extremes_are_drawn(tmp_path, rng, options):
    code, width, height = draw(tmp_path, make_scene(tmp_path, rng, **options))
    assert code == 0
    assert min(width, height) > 300


def test_large_crops_keep_their_pixels(tmp_path, rng):
    methods = make_scene(tmp_path, rng, size=(1200, 400), views=("a",), methods=1)
    _, width, _ = draw(tmp_path, methods)
    # The photo three crops wide, and three crops of 300.
    assert width >= 6 * 300


def other_render(folder, rng):
    image = rng.integers(0, 256, (30, 41, 3), dtype=np.uint8)
    images.write(folder / "method_1" / "renders" / "b.png", image)


def other_flow(folder, rng):
    flow_px = np.zeros((31, 40, 2), np.float32)
    files.write_flow(
        folder / "method_0" / "flow" / "a.npz", flow_px, np.ones((31, 40), bool)
    )


def no_flow(folder, rng):
    (folder / "method_1" / "flow" / "a.npz").unlink()


def no_photo(folder, rng):
    (folder / "photos" / "b.png").unlink()


def no_renders(folder, rng):
    for path in (folder / "method_0" / "renders").iterdir():
        path.unlink()


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (other_render, "method_1/renders/b.png: not of the size of photo b"),
        (other_flow, "method_0/flow/a.npz: not of the size of photo a"),
        (no_flow, "method_1/flow/a.npz"),
        (no_photo, "photos/b.png"),
        (no_renders, "method_0/renders: no renders"),
    ],
)
def test_what_is_missing_is_named(tmp_path, rng, capsys, damage, reason):
    methods = make_scene(tmp_path, rng)
    damage(tmp_path, rng)
    assert draw(tmp_path, methods) == (1, 0, 0)
    (error,) = capsys.readouterr().err.strip().splitlines()
    assert error.startswith("error: ")
    assert reason in error
