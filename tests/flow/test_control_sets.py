"""flow.control_sets as a command: its images, its table, and bad input."""

import csv
import shutil

import cv2
import numpy as np
import pytest

from alignerf import testsets
from alignerf.io import images, owned
from flow import control_sets
from flow.estimation import estimate
from flow.warping import controls, files, warp

VIEWS = ("a", "b c")
SHIFT_PX = 2
IMAGES = [one.name for one in testsets.drawn()]
SETS = {*IMAGES, "overfit_flow", "overfit.csv"}


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Photos, and renders of them that are blurred, in error and displaced."""
    folder = tmp_path_factory.mktemp("drawn")
    rng = np.random.default_rng(0)
    for view in VIEWS:
        large = sum(
            scale * cv2.GaussianBlur(rng.normal(size=(70, 90, 3)), (0, 0), scale)
            for scale in (1, 3, 8)
        )
        large = np.clip(127 + 45 * large / large.std(), 0, 255).astype(np.uint8)
        photo, oracle = large[5:65, 5:85], large[4:64, 7:87]
        errors = cv2.GaussianBlur(rng.normal(size=oracle.shape), (0, 0), 1.5)
        render = cv2.GaussianBlur(oracle, (0, 0), 1.0) + 8 * errors / errors.std()
        render = np.clip(np.rint(render), 0, 255).astype(np.uint8)
        images.write(folder / "photos" / f"{view}.png", photo)
        images.write(folder / "renders" / f"{view}.png", render)
        images.write(folder / "truth" / "oracle" / f"{view}.png", oracle)
        flow_px, valid, _ = estimate.flow_and_validity(render, photo)
        files.write_flow(folder / "flow" / f"{view}.npz", flow_px, valid)
    return folder


@pytest.fixture
def scene(drawn, tmp_path):
    """A copy of them."""
    return shutil.copytree(drawn, tmp_path, dirs_exist_ok=True)


def arguments(scene, *more):
    folders = ("renders", "photos", "flow", "out")
    return [part for name in folders for part in (f"--{name}", str(scene / name))] + [
        *more
    ]


def with_truth(scene):
    return arguments(scene, "--truth", str(scene / "truth"))


def read(scene, kind, view):
    return images.read(scene / kind / f"{view}.png")


def rows(scene):
    with open(scene / "out" / "overfit.csv", newline="") as file:
        return list(csv.DictReader(file))


def error(first, second):
    inner = np.s_[8:-8, 8:-8]
    return np.square(first[inner].astype(float) - second[inner]).mean()


def test_every_set_is_the_warp_that_it_says(scene):
    assert control_sets.run(with_truth(scene)) == 0
    assert {path.name for path in (scene / "out").iterdir()} == SETS
    for row, view in zip(rows(scene), VIEWS, strict=True):
        render, photo = (read(scene, kind, view) for kind in ("renders", "photos"))
        found = {kind: read(scene / "out", kind, view) for kind in IMAGES}
        oracle = read(scene, "truth/oracle", view)
        np.testing.assert_array_equal(found["aligned"], oracle)
        overfit_px, valid = files.read_flow(
            scene / "out" / "overfit_flow" / f"{view}.npz"
        )
        np.testing.assert_array_equal(found["overfit"], warp.warp(oracle, overfit_px))
        placebo_px = controls.placebo_flow(*photo.shape[:2], view=view)
        np.testing.assert_array_equal(found["placebo"], warp.warp(photo, placebo_px))
        # Back where it was, half a pixel away at most, and onto the render.
        flow_px, _ = files.read_flow(scene / "flow" / f"{view}.npz")
        np.testing.assert_array_equal(found["control"], warp.round_trip(photo, flow_px))
        assert error(found["crossfit"], render) < 0.5 * error(photo, render)
        assert error(found["overfit"], render) < error(oracle, render)
        assert error(found["overfit"], render) < error(
            found["overfit_crossfit"], render
        )
        assert (row["view"], row["aligned"]) == (view, "oracle")
        assert list(row) == list(controls.COLUMNS)
        wanted = files.statistics(overfit_px, valid, view=view)
        assert {key: float(row[key]) for key in wanted} == pytest.approx(wanted)
        assert 0 < float(row["median_px"]) < 0.5


def test_without_truth_a_copy_of_the_render_stands_in(scene):
    assert control_sets.run(arguments(scene)) == 0
    for row, view in zip(rows(scene), VIEWS, strict=True):
        assert row["aligned"] == "resharpened"
        # Two pixels and more lie between photo and render, none between render and
        # copy, whatever an estimator finds there.
        assert 0 < float(row["median_px"]) < 0.5
        render, photo = (read(scene, kind, view) for kind in ("renders", "photos"))
        aligned, overfit, crossfit = (
            error(read(scene / "out", kind, view), render)
            for kind in ("aligned", "overfit", "overfit_crossfit")
        )
        assert aligned < error(photo, render)
        assert overfit == pytest.approx(aligned, rel=0.1)
        assert crossfit > 0.95 * aligned


def test_again_gives_the_same_bits_and_nothing_stale(scene):
    assert control_sets.run(with_truth(scene)) == 0
    out = scene / "out"
    first = {path: path.read_bytes() for path in out.glob("*/*.png")}
    (out / "overfit" / "stale.png").write_text("of an older run")
    owned.seal(out / "overfit")
    (out / "warped").mkdir()
    assert control_sets.run(with_truth(scene)) == 0
    assert {path: path.read_bytes() for path in out.glob("*/*.png")} == first
    assert {path.name for path in out.iterdir()} == SETS | {"warped"}


def test_settings_reach_the_warps(scene):
    options = ("--no-match-blur", "--method", "dis_medium")
    assert control_sets.run([*with_truth(scene), *options]) == 0
    assert {row["blur_sigma_px"] for row in rows(scene)} == {"0.0"}
    overfit_px, _ = files.read_flow(scene / "out" / "overfit_flow" / "a.npz")
    render, oracle = read(scene, "renders", "a"), read(scene, "truth/oracle", "a")
    wanted_px, _, _ = estimate.flow_and_validity(
        render, oracle, method="dis_medium", match_blur=False
    )
    np.testing.assert_array_equal(overfit_px, wanted_px)
    np.testing.assert_array_equal(
        read(scene / "out", "overfit", "a"),
        warp.warp(oracle, overfit_px),
    )


def lose_oracle(scene):
    (scene / "truth" / "oracle" / "b c.png").unlink()


def lose_flow(scene):
    (scene / "flow" / "b c.npz").unlink()


def lose_photo(scene):
    (scene / "photos" / "b c.png").unlink()


def lose_render(scene):
    (scene / "renders" / "b c.png").unlink()


def resize_oracle(scene):
    image = read(scene, "truth/oracle", "b c")
    images.write(scene / "truth" / "oracle" / "b c.png", image[:-1])


def resize_flow(scene):
    flow_px, valid = files.read_flow(scene / "flow" / "b c.npz")
    files.write_flow(scene / "flow" / "b c.npz", flow_px[:-1], valid[:-1])


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lose_oracle, "truth/oracle/b c.png"),
        (lose_flow, "flow/b c.npz"),
        (lose_photo, "photos/b c.png: no photo for render"),
        (lose_render, "renders: no render of view b c"),
        (resize_oracle, "view b c: render and photo differ in size: 80x60"),
        (resize_flow, "view b c: image [60, 80] and flow [59, 80] differ in size"),
    ],
)
def test_bad_input_ends_in_one_line_and_nothing_written(scene, capsys, damage, reason):
    damage(scene)
    assert control_sets.run(with_truth(scene)) == 1
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("error: ")
    assert reason in line
    assert not list(scene.glob("out/**/*"))


@pytest.fixture
def folders(tmp_path):
    """Renders, and photos that are shifted against them by SHIFT_PX, of 11 views."""
    rng = np.random.default_rng(0)
    for number in range(control_sets.MAX_VIEWS + 3):
        noise = sum(
            scale * cv2.GaussianBlur(rng.normal(size=(70, 90, 3)), (0, 0), scale)
            for scale in (1, 3, 8)
        )
        large = np.clip(127 + 45 * noise / noise.std(), 0, 255).astype(np.uint8)
        render, photo = large[5:65, 5:85], large[5:65, 5 + SHIFT_PX : 85 + SHIFT_PX]
        name = f"v{number:02d}"
        images.write(tmp_path / "renders" / f"{name}.png", render)
        images.write(tmp_path / "photos" / f"{name}.png", photo)
        flow_px, valid, _ = estimate.flow_and_validity(render, photo)
        files.write_flow(tmp_path / "flow" / f"{name}.npz", flow_px, valid)
    return [tmp_path / name for name in ("renders", "photos", "flow", "out.csv")]


def test_it_is_small_where_photos_are_shifted_by_pixels(folders):
    rows = control_sets.main(*folders[:3], lengths=folders[3], threads=2)
    with open(folders[-1], newline="") as file:
        written = list(csv.DictReader(file))
    views = [row["view"] for row in written]
    assert views == [row["view"] for row in rows]
    assert len(views) == control_sets.MAX_VIEWS
    # From the first view to the last.
    assert (views[0], views[-1]) == ("v00", "v10")
    assert all(float(row["median_px"]) < 0.25 for row in written)


def test_a_fault_names_its_view_and_leaves_no_table(folders):
    renders, _, flow, out = folders
    flow_px, valid = files.read_flow(flow / "v00.npz")
    files.write_flow(flow / "v00.npz", flow_px[:-9], valid[:-9])
    with pytest.raises(ValueError, match="v00"):
        control_sets.main(*folders[:3], lengths=folders[3])
    assert not out.exists()
    (renders / "v05.png").unlink()
    (folders[1] / "v03.png").unlink()
    with pytest.raises(ValueError, match=r"v03\.png: no photo"):
        control_sets.main(*folders[:3], lengths=folders[3])


def test_one_view_is_enough(folders):
    for path in sorted(folders[0].iterdir())[1:]:
        path.unlink()
    (row,) = control_sets.main(*folders[:3], lengths=folders[3])
    assert row["view"] == "v00"
