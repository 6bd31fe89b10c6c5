"""Which render belongs to which photo."""

from pathlib import Path

import numpy as np
import pytest

from alignerf.judged import layouts, renders
from tests import judged_cases
from tests.judged_cases import NAMES, picture, write_png

SIZE = (40, 32)
PHOTOS = [f"IMG_{i}" for i in range(1, 13)]
HELD_OUT = {name: "test" if i % 8 == 0 else "train" for i, name in enumerate(NAMES)}


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    """Photos {view: path}."""
    folder = judged_cases.photos(tmp_path_factory.mktemp("photos"), size=(40, 32))
    return {name: folder / f"{name}.png" for name in NAMES}


def write(folder, *names):
    for name in names:
        write_png(folder / name, picture(0, (40, 32)))


def photos(folder, names):
    """{view: path} of a photo each."""
    for i, name in enumerate(names):
        write_png(folder / f"{name}.png", picture(i, SIZE))
    return {name.replace("/", "_"): folder / f"{name}.png" for name in names}


def written(folder, names):
    """Renders of these names."""
    write(folder, *(f"{name}.png" for name in names))
    return folder


def of(found):
    return {name: one.path.name for name, one in found.renders.items()}


def test_names_are_those_of_the_photos(tmp_path, taken):
    """Other suffixes, letters and words around a name do not matter."""
    write(
        tmp_path, "v00.png", "V01.png", "render_v02.png", "v03_rgb.png", "v04.jpg.png"
    )
    found = renders.find(tmp_path, taken)
    assert of(found)["v01"] == "V01.png"
    assert sorted(found.renders) == ["v00", "v01", "v02", "v03", "v04"]
    assert {one.split for one in found.renders.values()} == {None}


def test_links_are_followed_and_end(tmp_path, taken):
    """Splits that lie elsewhere; a link inside is no second render, nor is a ring."""
    for split, names in (("train", NAMES[1:]), ("test", NAMES[:1])):
        write(tmp_path / "far" / split, *(f"{name}.png" for name in names))
    folder = tmp_path / "renders"
    folder.mkdir()
    (folder / "train").symlink_to(tmp_path / "far" / "train")
    (folder / "test").symlink_to(tmp_path / "far" / "test")
    (folder / "latest").symlink_to(folder)
    (tmp_path / "far" / "train" / "back").symlink_to(folder)
    found = renders.find(folder, taken)
    assert {n: one.split for n, one in found.renders.items()} == HELD_OUT


def test_nerfstudio(tmp_path, taken):
    """ns-render dataset; its copies of photos and coloured depths are none."""
    for split, names in (("train", NAMES[1:]), ("test", NAMES[:1])):
        for kind in ("rgb", "gt-rgb", "depth", "background", "pred_normals"):
            write(tmp_path / split / kind, *(f"{name}.png" for name in names))
    found = renders.find(tmp_path, taken)
    assert {n: one.split for n, one in found.renders.items()} == HELD_OUT
    assert all("/rgb/" in str(one.path) for one in found.renders.values())


def test_gaussian_splatting(tmp_path, taken):
    """render.py numbers each split by name; the last iteration counts."""
    for number in (7000, 30000):
        for split, count in (("train", 7), ("test", 1)):
            folder = tmp_path / split / f"ours_{number}"
            for kind in ("renders", "gt"):
                write(folder / kind, *(f"{i:05}.png" for i in range(count)))
    found = renders.find(tmp_path, taken)
    assert {n: one.split for n, one in found.renders.items()} == HELD_OUT
    assert found.renders["v00"].path.name == "00000.png"
    assert found.renders["v01"].path.name == "00000.png"
    assert all("ours_30000" in str(one.path) for one in found.renders.values())


def test_gsplat(tmp_path, taken):
    """Photo and render side by side, of held-out views, of the last step."""
    write(tmp_path / "renders", "val_step6999_0000.png", "val_step29999_0000.png")
    found = renders.find(tmp_path, taken)
    assert of(found) == {"v00": "val_step29999_0000.png"}
    assert found.renders["v00"].sheet
    assert found.renders["v00"].split == "test"


def test_gsplat_of_all_views(tmp_path, taken):
    """With --test-every 1 all are numbered; what was learnt from, the cameras say."""
    write(tmp_path, *(f"val_step9_{i:04}.png" for i in range(8)))
    found = renders.find(tmp_path, taken)
    assert of(found)["v05"] == "val_step9_0005.png"
    assert {n: one.split for n, one in found.renders.items()} == HELD_OUT


def test_gaussian_splatting_that_held_nothing_out(tmp_path, taken):
    folder = tmp_path / "train" / "ours_30000" / "renders"
    write(folder, *(f"{i:05}.png" for i in range(8)))
    found = renders.find(tmp_path, taken)
    assert of(found)["v00"] == "00000.png"
    assert {one.split for one in found.renders.values()} == {"train"}


def test_numbers_of_what_was_learnt_are_no_names_of_numbered_photos(tmp_path):
    """Of photos 00000 to 00023 the renders 00000 to 00020 leave out every eighth."""
    names = [f"{i:05}" for i in range(24)]
    taken = photos(tmp_path / "photos", names)
    found = of(renders.find(written(tmp_path / "out", names[:21]), taken))
    assert [*found] == [name for i, name in enumerate(names) if i % 8]


def test_full_names_are_counted_with_their_suffixes(tmp_path):
    """As 3D Gaussian splatting and gsplat sort them."""
    written(tmp_path, [f"train/ours_7/renders/{i:05}" for i in range(4)])
    found = of(
        renders.find(tmp_path, photos(tmp_path / "photos", ["a", "a-1", "b", "b-1"]))
    )
    assert sorted(found, key=found.get) == ["a-1", "a", "b-1", "b"]


def test_of_a_sheet_the_right_half_is_the_render(tmp_path):
    sheet = np.concatenate([picture(1, SIZE), picture(2, SIZE)], axis=1)
    write_png(tmp_path / "val_step9_0000.png", sheet)
    one = layouts.Render(tmp_path / "val_step9_0000.png", sheet=True)
    assert one.size == SIZE
    np.testing.assert_array_equal(one.half(sheet), picture(2, SIZE))


@pytest.mark.parametrize(
    ("layout", "last"),
    [
        ("val_step9_{:04}.png", 11),
        ("train/ours_7/renders/{:05}.png", 11),
        ("train/ours_7/renders/{:05}.png", 10**30),
    ],
)
def test_as_many_as_views_but_under_another_number(tmp_path, taken, layout, last):
    files = [layout.format(number) for number in (*range(7), last)]
    write(tmp_path, *files)
    says = rf"{files[-1]}: there are 8 views by the .*, so none has the number {last}$"
    with pytest.raises(ValueError, match=says):
        renders.find(tmp_path, taken)


def test_a_render_of_gaussian_splatting_has_a_number(tmp_path, taken):
    write(tmp_path / "train" / "ours_7" / "renders", "00000.png", "²².png")
    with pytest.raises(ValueError, match=r"²²\.png: not a number"):
        renders.find(tmp_path, taken)


def test_numbers_in_the_order_of_names(tmp_path, taken):
    """As many as photos, or as there are held-out ones."""
    write(tmp_path / "all", *(f"color_{i}.png" for i in range(8, 16)))
    assert of(renders.find(tmp_path / "all", taken))["v03"] == "color_11.png"
    write(tmp_path / "few", "color_000.png")
    found = renders.find(tmp_path / "few", taken)
    assert found.renders["v00"].split == "test"


def test_the_cameras_say_what_is_held_out(tmp_path, taken):
    own = {name: "test" if name in ("v02", "v05") else "train" for name in NAMES}
    for i, shown in enumerate((2, 5)):
        write_png(tmp_path / "test" / f"{i:03}.png", picture(shown, (40, 32)))
    assert set(renders.find(tmp_path, taken, own).renders) == {"v02", "v05"}


@pytest.mark.parametrize(
    ("files", "says"),
    [
        (["a.png", "b.png"], "not called like the photos"),
        (["v00.png", "x/v00.png"], "both of view v00"),
        ([], "no renders"),
    ],
)
def test_what_cannot_be_told_is_said(tmp_path, taken, files, says):
    write(tmp_path, *files)
    with pytest.raises(ValueError, match=says):
        renders.find(tmp_path, taken)


def test_no_folder(tmp_path, taken):
    with pytest.raises(ValueError, match="no folder of renders"):
        renders.find(tmp_path / "gone", taken)


def test_a_render_of_no_photo_is_left_out(tmp_path, taken, caplog):
    write(tmp_path, "v00.png", "sky.png")
    assert list(renders.find(tmp_path, taken).renders) == ["v00"]
    assert "sky.png" in caplog.text


def test_of_folders_of_steps_the_last_counts(tmp_path, taken):
    """Those of cameras are no steps, though their files may be called alike."""
    for step in (5000, 30000):
        write(tmp_path / f"eval_{step}", *(f"{name}.png" for name in taken))
    found = renders.find(tmp_path, taken)
    assert len(found.renders) == len(taken)
    assert {one.path.parent.name for one in found.renders.values()} == {"eval_30000"}
    few = [Path(f"cam{i}/v00.png") for i in range(2)]
    assert renders.of_last(few, {}) == few


@pytest.mark.parametrize("place", ["out.mp4", "."])
def test_a_film_is_told_how_to_become_renders(tmp_path, taken, place):
    (tmp_path / "out.mp4").write_bytes(b"")
    with pytest.raises(ValueError, match=r"out\.mp4: a video: .* ffmpeg -i"):
        renders.find(tmp_path / place, taken)


def test_a_folder_of_photos_by_its_name_is_told_from_that_of_renders(tmp_path, taken):
    write(tmp_path / "ours_7" / "gt", *(f"{i:05}.png" for i in range(8)))
    assert len(renders.find(tmp_path / "ours_7" / "gt", taken).renders) == 8
    write(tmp_path / "ours_7" / "renders", "00000.png")
    with pytest.raises(
        ValueError, match=r"photos, by its name: renders lie in .*renders"
    ):
        renders.find(tmp_path / "ours_7" / "gt", taken)


def test_numbers_from_0_on_are_not_those_of_photos_from_1_on(tmp_path):
    """Most are called like a photo, and show the next."""
    taken = photos(tmp_path / "photos", [f"{i:04}" for i in range(1, 13)])
    folder = written(tmp_path / "renders", [f"{i:04}" for i in range(12)])
    found = of(renders.find(folder, taken))
    assert found == {f"{i + 1:04}": f"{i:04}.png" for i in range(12)}


@pytest.mark.parametrize("numbers", [range(1, 13), (2, 3, 5, 7), (12,)])
@pytest.mark.parametrize("name", ["{:05}", "r_{}_rgb", "IMG_{:03}"])
def test_renders_may_have_the_numbers_of_their_photos(tmp_path, numbers, name):
    taken = photos(tmp_path / "photos", PHOTOS)
    folder = written(tmp_path / "r", map(name.format, numbers))
    found = of(renders.find(folder, taken))
    assert found == {f"IMG_{n}": f"{name.format(n)}.png" for n in numbers}


def test_numbered_renders_of_another_count_are_told_how_to_be_named(tmp_path):
    taken = photos(tmp_path / "photos", PHOTOS)
    folder = written(tmp_path / "renders", range(11))
    with pytest.raises(ValueError, match="give each the name of its photo"):
        renders.find(folder, taken)


def test_depths_normals_and_photos_among_renders_are_none(tmp_path):
    taken = photos(tmp_path / "photos", PHOTOS)
    for kind in ("", "_depth", "_normal", "_gt", "-alpha", ".mask"):
        numbers = [f"{i:05}{kind}" for i in range(12)]
        written(tmp_path / "renders", numbers)
    found = renders.find(tmp_path / "renders", taken)
    assert {one.path.stem for one in found.renders.values()} == {
        f"{i:05}" for i in range(12)
    }
    alone = {"depth_1": taken["IMG_1"]}
    written(tmp_path / "other", ["depth_1"])
    assert [*renders.find(tmp_path / "other", alone).renders] == ["depth_1"]


@pytest.mark.parametrize(
    ("name", "render"),
    [
        ("cam0/1", "cam0/1"),
        ("cam0/1", "test/rgb/cam0/1"),
        ("cam0/1", "cam0_1"),
        ("cam0/1", "cam0-1.jpg"),
        ("cam0/1", "render_cam0_1"),
        ("IMG 1 (2)", "IMG%201%20(2)"),
        ("IMG 1 (2)", "img_1_2"),
        ("IMG 1 (2)", "IMG 1 (2)_rgb"),
        ("IMG_1", "IMG_1 (1)"),
        ("IMG_1", "img_1 - Copy (2)"),
        ("Ä", "a\u0308"),
    ],
)
def test_a_render_is_called_like_its_photo_loosely(tmp_path, name, render):
    names = [name, "cam1/1", "other"]
    taken = photos(tmp_path / "photos", names)
    found = renders.find(written(tmp_path / "renders", [render, "other"]), taken)
    assert {*found.renders} == {name.replace("/", "_"), "other"}


def test_a_name_that_two_photos_fit_is_of_neither(tmp_path):
    taken = photos(tmp_path / "photos", ["cam0/1", "cam1/1", "a b", "a_b"])
    called = renders.Called(taken)
    assert called.view_of(tmp_path / "1.png") == (None, 0)
    assert called.view_of(tmp_path / "A-B.png") == (None, 0)
    assert called.view_of(tmp_path / "a b.png") == ("a b", 0)


def test_a_copy_does_not_come_before_the_file(tmp_path):
    taken = photos(tmp_path / "photos", ["IMG_1", "IMG_2"])
    folder = written(tmp_path / "r", ["IMG_1 (1)", "IMG_1", "IMG_2"])
    found = renders.find(folder, taken)
    assert found.renders["IMG_1"].path.stem == "IMG_1"
    assert [path.stem for path in found.left_out] == ["IMG_1 (1)"]


def test_folders_of_cameras_are_no_steps_though_they_have_numbers(tmp_path):
    names = [f"DJI_0{n}/{i:06}" for n in (238, 286) for i in range(2)]
    taken = photos(tmp_path / "photos", names)
    found = renders.find(written(tmp_path / "renders", names), taken).renders
    assert [one.path.relative_to(tmp_path / "renders") for one in found.values()] == [
        path.relative_to(tmp_path / "photos") for path in taken.values()
    ]
