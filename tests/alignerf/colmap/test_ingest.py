"""A folder of photos and films, and the cameras that took them."""

import shutil

import numpy as np
import pytest
from PIL import Image

from alignerf.colmap import ingest
from alignerf.io import images


@pytest.fixture
def pixels(rng):
    """An image without symmetry [12, 20, 3]."""
    return rng.integers(0, 256, (12, 20, 3), dtype=np.uint8)


def save(path, pixels, **options):
    Image.fromarray(pixels).save(path, **options)


def test_photos_are_sorted_by_view_name_and_the_rest_is_left_out(
    tmp_path, pixels, caplog
):
    source, target = tmp_path / "in", tmp_path / "out"
    source.mkdir(), target.mkdir()
    for name in ("b 2.JPG", "a.b.png", "ä.tiff", "a.bmp"):
        save(source / name, pixels)
    (source / ".hidden.jpg").write_bytes(b"")
    (source / "notes.txt").write_text("x")
    (source / "folder.jpg").mkdir()
    taken = ingest.ingest(source, target)
    assert taken.names == ["a", "a.b", "b 2", "ä"]
    assert set(taken.sizes) == {(20, 12)}
    assert "notes.txt" in caplog.text
    assert "hidden" not in caplog.text
    for i, name in enumerate(taken.names):
        assert images.read(taken.folder / f"{name}.png").shape == pixels.shape
        assert taken.load(i).shape == pixels.shape
    np.testing.assert_array_equal(taken.load(1), pixels)


def test_copies_are_no_larger_than_asked_and_photos_stay_whole(tmp_path, pixels):
    source, target = tmp_path / "in", tmp_path / "out"
    source.mkdir(), target.mkdir()
    save(source / "a.png", pixels.repeat(10, 0).repeat(10, 1))
    taken = ingest.ingest(source, target, max_side_px=100)
    assert taken.copy_sizes == [(100, 60)]
    assert images.read(taken.folder / "a.png").shape == (60, 100, 3)
    assert taken.load(0).shape == (120, 200, 3)


def test_each_size_has_a_camera_of_its_own(tmp_path, pixels):
    source, target = tmp_path / "in", tmp_path / "out"
    source.mkdir(), target.mkdir()
    for name, image in {"a": pixels, "b": ~pixels, "odd one": pixels[:, :10]}.items():
        save(source / f"{name}.png", image)
    taken = ingest.ingest(source, target)
    assert taken.cameras.tolist() == [0, 0, 1]
    # It lies with its longer side as the others.
    assert taken.sizes[2] == (12, 10)
    assert taken.camera(1).names == ["odd one"]
    assert taken.load(2).shape == (10, 12, 3)


@pytest.mark.parametrize("name", ["a.jpg.png", "a.png"])
def test_a_mask_lies_as_its_photo_does(tmp_path, pixels, name):
    source, target, masks = (tmp_path / part for part in ("in", "out", "masks"))
    for folder in (source, target, masks):
        folder.mkdir()
    exif = Image.Exif()
    exif[0x0112] = 3
    save(source / "a.jpg", pixels, exif=exif)
    save(source / "b.jpg", ~pixels)
    save(source / "c.jpg", pixels)
    mask = np.full((12, 20), 255, np.uint8)
    mask[:, :5] = 0
    Image.fromarray(mask).save(masks / name)
    taken = ingest.ingest(source, target, masks=masks)
    # Most lie as stored, and so does the mask of the one that is upside down.
    np.testing.assert_array_equal(taken.load_mask(0)[..., 0], mask)
    assert (taken.load_mask(1) == 255).all()
    copy = images.read(target / "copies_masks/a.png.png")
    np.testing.assert_array_equal(copy, taken.load_mask(0))


def test_masks_that_do_not_belong_are_named(tmp_path, pixels):
    save(tmp_path / "a.png", pixels)
    (tmp_path / "masks").mkdir()
    (tmp_path / "out").mkdir()
    with pytest.raises(ValueError, match="masks: no mask <photo's file name>"):
        ingest.ingest(tmp_path, tmp_path / "out", masks=tmp_path / "masks")
    save(tmp_path / "masks/a.png.png", pixels[:6])
    (tmp_path / "out2").mkdir()
    with pytest.raises(ValueError, match=r"a\.png\.png is 20x6, its photo 20x12"):
        ingest.ingest(tmp_path, tmp_path / "out2", masks=tmp_path / "masks")


def test_a_photo_and_a_frame_of_one_name_are_refused(tmp_path, pixels, monkeypatch):
    def extract(film, frames):
        save(frames / "a.png", pixels)
        return [frames / "a.png"]

    monkeypatch.setattr(ingest.video, "extract", extract)
    (tmp_path / "in").mkdir()
    save(tmp_path / "in/a.jpg", pixels)
    (tmp_path / "in/film.mp4").write_bytes(b"x")
    with pytest.raises(
        ValueError, match=r"a.jpg and a frame of film.mp4 have the same"
    ):
        ingest.ingest(tmp_path / "in", tmp_path)


@pytest.mark.parametrize(
    ("kinds", "focals_px", "numbers"),
    [
        ("sss", [1000, np.nan, 1000], [0, 0, 0]),
        ("sss", [np.nan] * 3, [0, 0, 0]),
        ("ssss", [1000, 2000, 1000, 2000], [0, 1, 0, 1]),
        # Rounded to a millimetre, but one lens.
        ("sss", [1000, 1030, 1000], [0, 0, 0]),
        ("ssa", [1000, 1000, 1000], [0, 0, 1]),
        # A zoom that is never the same: all alone.
        ("sssss", [1000, 1100, 1210, 1331, 1464], [0, 1, 2, 3, 4]),
        # A film, or another phone, is of another kind.
        (["s", "s", ("s", "film")], [1000, 1000, np.nan], [0, 0, 1]),
    ],
)
def test_what_lies_alike_at_one_zoom_is_one_camera(kinds, focals_px, numbers):
    kinds, focals_px = list(kinds), np.array(focals_px, np.float64)
    found = ingest.share_cameras(kinds, focals_px)
    if len(set(numbers)) > max(2, len(numbers) // 3):
        numbers = list(range(len(numbers)))
    assert found.tolist() == numbers


def test_a_live_photo_is_a_photo(tmp_path, pixels, caplog, monkeypatch):
    monkeypatch.setattr(ingest.video, "extract", None)
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    save(tmp_path / "in/IMG_1.jpg", pixels)
    (tmp_path / "in/IMG_1.MOV").write_bytes(b"x")
    taken = ingest.ingest(tmp_path / "in", tmp_path / "out")
    assert taken.names == ["IMG_1"]
    assert "left out IMG_1.MOV: a photo of that name is there" in caplog.text


def test_two_films_of_one_name_are_refused(tmp_path):
    for name in ("w.avi", "w.mkv"):
        (tmp_path / name).write_bytes(b"x")
    with pytest.raises(ValueError, match=r"w\.avi and w\.mkv would give the same"):
        ingest.find(tmp_path, tmp_path)


def test_two_phones_of_one_size_are_two_cameras(tmp_path, pixels):
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    for name, model in {"a": "One", "b": "Two", "c": "One"}.items():
        exif = Image.Exif()
        exif[0x0110] = model
        save(tmp_path / f"in/{name}.jpg", pixels ^ ord(name), exif=exif)
    taken = ingest.ingest(tmp_path / "in", tmp_path / "out")
    assert taken.cameras.tolist() == [0, 1, 0]


def test_the_same_photo_again_is_left_out_by_name(tmp_path, pixels, caplog):
    """A copy, a link, and among them one that only looks alike."""
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    save(tmp_path / "in/a.png", pixels)
    shutil.copy(tmp_path / "in/a.png", tmp_path / "in/a copy.png")
    (tmp_path / "in/z.png").symlink_to("a.png")
    save(tmp_path / "in/b.png", pixels ^ 1)
    taken = ingest.ingest(tmp_path / "in", tmp_path / "out")
    assert taken.names == ["a", "b"]
    assert "left out a copy.png (as a.png), z.png (as a.png)" in caplog.text
    assert ingest.once_more(tmp_path / "in", tmp_path / "out").names == ["a", "b"]


def masked(tmp_path, pixels, masks):
    """A folder of photos a, b and c, and one of masks of these names."""
    for name in ("in", "masks", "out"):
        (tmp_path / name).mkdir()
    for name in "abc":
        save(tmp_path / f"in/{name}.jpg", pixels ^ ord(name))
    for name, value in masks.items():
        mask = np.full(pixels.shape[:2], value, np.uint8)
        Image.fromarray(mask).save(tmp_path / "masks" / name)
    folders = [tmp_path / name for name in ("in", "out", "masks")]
    return lambda: ingest.ingest(*folders[:2], masks=folders[2])


def test_masks_of_no_photo_and_photos_without_one_are_named(tmp_path, pixels, caplog):
    white = dict.fromkeys(("a.jpg.png", "a.png", "d.jpg.png", "B.png", ".x.png"), 255)
    taken = masked(tmp_path, pixels, white)()
    assert [mask and mask.name for mask in taken.masks] == ["a.jpg.png", "B.png", None]
    assert "masks: no mask of c.jpg: all of it is learned from" in caplog.text
    assert "and left out: a.png, d.jpg.png\n" in caplog.text


def test_masks_that_fit_are_not_spoken_of(tmp_path, pixels, caplog):
    masked(tmp_path, pixels, dict.fromkeys(("a.png", "b.jpg.png", "c.png"), 9))()
    assert "mask" not in caplog.text


def test_a_mask_that_is_all_black_is_named_before_colmap(tmp_path, pixels):
    read = masked(tmp_path, pixels, {"a.png": 255, "b.png": 0, "c.png": 255})
    with pytest.raises(ValueError, match=r"masks/b\.png: it hides the whole photo"):
        read()


def test_a_folder_of_masks_that_is_none_is_named(tmp_path, pixels):
    masked(tmp_path, pixels, {})
    with pytest.raises(ValueError, match=r"no folder of masks at .*none"):
        ingest.ingest(tmp_path / "in", tmp_path / "out", masks=tmp_path / "none")
