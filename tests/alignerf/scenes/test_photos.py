"""Every kind of image file that real folders hold: handled, or refused by name."""

import struct
import subprocess
import sys
import zlib

import cv2
import numpy as np
import pytest
from PIL import Image

from alignerf.scenes import photos


@pytest.fixture
def pixels():
    """An image without symmetry [12, 20, 3]."""
    return np.random.default_rng(0).integers(0, 256, (12, 20, 3), dtype=np.uint8)


def save(path, pixels, **options):
    Image.fromarray(pixels).save(path, **options)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_is_applied_once(tmp_path, pixels, orientation):
    def stored(image):
        """The rows that a camera would store for a scene that looks like `image`."""
        undo = {
            1: lambda a: a,
            2: np.fliplr,
            3: lambda a: np.rot90(a, 2),
            4: np.flipud,
            5: lambda a: a.swapaxes(0, 1),
            6: np.rot90,
            7: lambda a: np.rot90(a, 2).swapaxes(0, 1),
            8: lambda a: np.rot90(a, -1),
        }
        return np.ascontiguousarray(undo[orientation](image))

    exif = Image.Exif()
    exif[0x0112] = orientation
    save(tmp_path / "a.png", stored(pixels), exif=exif)
    upright, _ = photos.decode(tmp_path / "a.png")
    as_stored, _ = photos.decode(tmp_path / "a.png", upright=False)
    np.testing.assert_array_equal(upright, pixels)
    np.testing.assert_array_equal(as_stored, stored(pixels))


def test_depths_and_colour_modes(tmp_path, pixels):
    grey = pixels[..., 0]
    deep = grey.astype(np.uint16) * 257
    cases = {
        "grey.png": (grey, grey[..., None]),
        "deep.png": (deep, grey[..., None]),
        "deep.tif": (deep, grey[..., None]),
        "opaque.png": (np.dstack([pixels, np.full_like(grey, 255)]), pixels),
        "grey alpha.png": (np.dstack([grey, np.full_like(grey, 255)]), grey[..., None]),
        "rgb.webp": (pixels, None),
    }
    for name, (stored, expected) in cases.items():
        save(
            tmp_path / name, stored, **({} if expected is not None else {"quality": 9})
        )
        image, focal_px = photos.decode(tmp_path / name)
        assert image.dtype == np.uint8
        assert image.shape == pixels.shape
        assert np.isnan(focal_px)
        if expected is not None:
            np.testing.assert_array_equal(image, np.broadcast_to(expected, image.shape))
    Image.fromarray(pixels).convert("CMYK").save(tmp_path / "c.tif")
    np.testing.assert_array_equal(photos.decode(tmp_path / "c.tif")[0], pixels)
    Image.fromarray(pixels).quantize(8).save(tmp_path / "p.png")
    assert photos.decode(tmp_path / "p.png")[0].shape == pixels.shape


def png_claiming(width, height):
    """A PNG whose header promises a size that its data do not hold."""

    def chunk(kind, body):
        return (
            struct.pack(">I", len(body))
            + kind
            + body
            + struct.pack(">I", zlib.crc32(kind + body))
        )

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = chunk(b"IDAT", zlib.compress(b"\0" * 100))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + data + chunk(b"IEND", b"")


def broken_files(folder, pixels):
    save(folder / "whole.jpg", pixels.repeat(8, 0).repeat(8, 1))
    save(folder / "whole.png", pixels)
    whole_jpg = (folder / "whole.jpg").read_bytes()
    whole_png = (folder / "whole.png").read_bytes()
    flipped = bytearray(whole_png)
    flipped[len(flipped) // 2] ^= 0xFF
    return {
        "truncated.jpg": whole_jpg[: len(whole_jpg) * 2 // 3],
        "truncated.png": whole_png[: len(whole_png) // 2],
        "flipped.png": bytes(flipped),
        "text.jpg": b"not an image",
        "empty.jpg": b"",
        "bomb.png": png_claiming(60000, 60000),
    }


def test_broken_files_are_refused_by_name(tmp_path, pixels):
    for name, data in broken_files(tmp_path, pixels).items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(ValueError, match=name):
            photos.decode(tmp_path / name)
    with pytest.raises(ValueError, match=r"none\.png: not found"):
        photos.decode(tmp_path / "none.png")


def test_what_cannot_be_a_photo_is_refused_by_name(tmp_path, pixels):
    alpha = np.full(pixels.shape[:2], 255, np.uint8)
    alpha[3, 4] = 254
    save(tmp_path / "holes.png", np.dstack([pixels, alpha]))
    save(tmp_path / "real.tif", pixels[..., 0].astype(np.float32))
    save(tmp_path / "long.tif", np.full((4, 4), 70000, np.int32))
    for name in ("holes.png", "real.tif", "long.tif"):
        with pytest.raises(ValueError, match=name):
            photos.decode(tmp_path / name)


def test_folders_that_cannot_be_used(tmp_path, pixels):
    with pytest.raises(ValueError, match="nowhere"):
        photos.find_images(tmp_path / "nowhere")
    with pytest.raises(ValueError, match=str(tmp_path)):
        photos.find_images(tmp_path)
    save(tmp_path / "a.png", pixels)
    save(tmp_path / "a.jpg", pixels)
    with pytest.raises(ValueError, match=r"a\.jpg and a\.png|a\.png and a\.jpg"):
        photos.find_images(tmp_path)


def test_focal_length_from_exif(tmp_path):
    """A lens of 43.27 mm equivalent sees its image's diagonal at its own length."""
    exif = Image.Exif()
    exif.get_ifd(photos.EXIF)[photos.TAG.FocalLengthIn35mmFilm] = 26
    save(tmp_path / "a.jpg", np.zeros((3000, 4000, 3), np.uint8), exif=exif)
    _, focal_px = photos.decode(tmp_path / "a.jpg")
    assert focal_px == pytest.approx(26 / 43.2666 * 5000)


def test_a_heic_photo_is_decoded_and_tells_its_size(tmp_path, pixels):
    big = pixels.repeat(8, 0).repeat(8, 1)
    exif = Image.Exif()
    exif.get_ifd(photos.EXIF)[photos.TAG.FocalLengthIn35mmFilm] = 26
    save(tmp_path / "a.heic", big, quality=95, exif=exif)
    assert photos.find_images(tmp_path) == {"a": tmp_path / "a.heic"}
    assert photos.head(tmp_path / "a.heic")[:2] == ((160, 96), 1)
    image, focal_px = photos.decode(tmp_path / "a.heic")
    assert image.shape == big.shape
    assert np.abs(image.astype(int) - big).mean() < 10
    assert focal_px == pytest.approx(26 / 43.2666 * np.hypot(160, 96))


def test_a_head_is_read_before_the_pixels(tmp_path, pixels):
    save(tmp_path / "a.jpg", pixels.repeat(40, 0).repeat(40, 1))
    whole = (tmp_path / "a.jpg").read_bytes()
    (tmp_path / "a.jpg").write_bytes(whole[: len(whole) // 2])
    assert photos.head(tmp_path / "a.jpg")[:3] == ((800, 480), 1, "")
    with pytest.raises(ValueError, match=r"cannot decode .*a\.jpg"):
        photos.decode(tmp_path / "a.jpg")


@pytest.mark.parametrize("orientation", [0, 9, 65535])
def test_an_orientation_that_exif_has_not_is_none(tmp_path, pixels, orientation):
    exif = Image.Exif()
    exif[0x0112] = orientation
    save(tmp_path / "a.png", pixels, exif=exif)
    assert photos.head(tmp_path / "a.png").orientation == 1


def test_a_file_of_another_kind_is_not_opened_whatever_its_name(tmp_path):
    (tmp_path / "a.png").write_bytes(
        b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n"
    )
    with pytest.raises(ValueError, match=r"cannot decode .*a\.png"):
        photos.decode(tmp_path / "a.png")


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_heic_of_one_phone_is_as_its_sensor_saw_it(tmp_path, pixels, orientation):
    """A phone writes how it was held into the file, and decoders turn the rows."""
    stored = pixels.repeat(8, 0).repeat(8, 1)
    image = Image.fromarray(stored)
    exif = Image.Exif()
    exif[0x0112] = orientation
    image.info["exif"] = exif.tobytes()
    image.save(tmp_path / "a.heic", quality=95)
    assert photos.head(tmp_path / "a.heic")[:2] == ((160, 96), orientation)
    found, _ = photos.decode(tmp_path / "a.heic", upright=False)
    assert np.abs(found.astype(int) - stored).mean() < 10
    upright, _ = photos.decode(tmp_path / "a.heic")
    meant = photos.UPRIGHT[orientation](stored)
    assert np.abs(upright.astype(int) - meant).mean() < 10


@pytest.mark.parametrize("orientation", [3, 6])
def test_a_tiff_that_pillow_turns_is_not_turned_again(tmp_path, pixels, orientation):
    exif = Image.Exif()
    exif[0x0112] = orientation
    save(tmp_path / "a.tif", pixels, exif=exif)
    found = photos.head(tmp_path / "a.tif")
    image, _ = photos.decode(tmp_path / "a.tif", upright=False)
    assert found[:3] == (image.shape[1::-1], 1, "")
    np.testing.assert_array_equal(image, photos.UPRIGHT[orientation](pixels))


@pytest.mark.parametrize("orientation", [1, 6])
@pytest.mark.parametrize("least_px", [40, 90, 130, 700])
def test_a_jpeg_is_decoded_smaller_but_not_below_a_size(
    tmp_path, rng, orientation, least_px
):
    noise = cv2.GaussianBlur(rng.normal(size=(600, 840, 3)), (0, 0), 25)
    image = Image.fromarray(np.uint8((128 + 40 * noise / noise.std()).clip(0, 255)))
    exif = Image.Exif()
    exif[0x0112] = orientation
    image.save(tmp_path / "a.jpg", exif=exif, quality=95)
    whole = photos.upright(tmp_path / "a.jpg")
    small = photos.decode(tmp_path / "a.jpg", least_px=least_px)[0]
    assert min(600, least_px) <= min(small.shape[:2]) < max(2 * least_px, 160)
    wanted = cv2.resize(whole, small.shape[1::-1], interpolation=cv2.INTER_AREA)
    assert np.abs(small.astype(int) - wanted).max() < 12


def test_undoing_an_orientation_gives_the_rows_back(pixels):
    for number, upright in photos.UPRIGHT.items():
        undo = photos.UPRIGHT[photos.UNDONE_BY[number]]
        np.testing.assert_array_equal(undo(upright(pixels)), pixels)


@pytest.mark.parametrize(
    ("name", "said"),
    [("a\rb.png", r"'a\\rb\.png'"), ("=cmd|A0.png", r"=cmd\|A0\.png")],
)
def test_a_name_that_is_none_of_a_view_is_refused(tmp_path, pixels, name, said):
    save(tmp_path / name, pixels)
    with pytest.raises(ValueError, match=rf"{said}: rename this file"):
        photos.find_images(tmp_path)


def test_folders_and_dead_links_beside_photos_are_named(tmp_path, pixels, caplog):
    save(tmp_path / "a.png", pixels)
    (tmp_path / "100APPLE").mkdir()
    (tmp_path / "masks").mkdir()
    (tmp_path / "b.png").symlink_to(tmp_path / "nowhere")
    save(tmp_path / "a_depth.png", pixels)
    assert photos.find_images(tmp_path) == {"a": tmp_path / "a.png"}
    assert "ignored 100APPLE, a_depth.png, b.png: not images" in caplog.text


def test_grey_of_16_bits_is_depth_among_photos(tmp_path, pixels):
    save(tmp_path / "a.jpg", pixels)
    Image.fromarray(np.full((40, 50), 1000, np.uint16)).save(tmp_path / "b.png")
    assert photos.find_images(tmp_path) == {"a": tmp_path / "a.jpg"}
    (tmp_path / "a.jpg").unlink()
    assert photos.find_images(tmp_path) == {"b": tmp_path / "b.png"}


def textured(rng, height, width):
    """Smooth noise [height, width, 3] whose left border goes on at its right one."""
    small = rng.uniform(0, 255, (height // 8, width // 8, 3))
    wide = np.concatenate([small] * 3, axis=1).astype(np.float32)
    large = cv2.resize(wide, (3 * width, height), interpolation=cv2.INTER_CUBIC)
    large += rng.normal(0, 3, large.shape)
    return np.clip(large[:, width : 2 * width], 0, 255).astype(np.uint8)


@pytest.mark.parametrize("seed", range(5))
def test_panoramas_are_known_by_their_borders(tmp_path, seed):
    rng = np.random.default_rng(seed)
    paths = [tmp_path / f"{i}.jpg" for i in range(12)]
    for path in paths:
        save(path, textured(rng, 128, 256))
    with pytest.raises(ValueError, match=r": 0\.jpg: EQUIRECTANGULAR.*cube faces"):
        photos.check_pinhole(paths, tmp_path)
    plain = np.full((128, 256, 3), 255, np.uint8)
    cut = textured(rng, 160, 320)
    plain[20:100, 40:200] = cut[20:100, 40:200]
    for image in (cut[:128, 40:296], plain, cut[:100, :256]):
        for path in paths:
            save(path, image)
        photos.check_pinhole(paths, tmp_path)


@pytest.mark.parametrize("channels", [3, 4])
def test_16_bits_a_colour_are_rounded_not_cut(tmp_path, rng, channels):
    deep = rng.integers(0, 65536, (40, 50, channels), dtype=np.uint16)
    deep[..., 3:] = 65535
    deep[0, 0, :3] = (65535, 128, 129)
    order = [2, 1, 0, 3][:channels]
    cv2.imwrite(str(tmp_path / "a.png"), deep[..., order])
    found, _ = photos.decode(tmp_path / "a.png")
    assert (found == np.round(deep[..., :3] / 257).astype(np.uint8)).all()


def test_16_bits_and_transparent_stand_on_a_background(tmp_path):
    deep = np.full((40, 50, 4), 30000, np.uint16)
    deep[:20, :, 3] = 0
    cv2.imwrite(str(tmp_path / "a.png"), deep)
    with pytest.raises(ValueError, match=r"a\.png has transparent pixels"):
        photos.decode(tmp_path / "a.png")
    found, _ = photos.decode(tmp_path / "a.png", "white")
    assert (found[:20] == 255).all()
    assert (found[20:] < 255).all()


DECODE = """
import re, sys
from alignerf.scenes import photos
image, _ = photos.decode(sys.argv[1])
# Not getrusage's peak, which begins with that of the process that started this one.
print(*image.shape, re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])
"""


@pytest.mark.whole
def test_the_largest_photo_takes_less_than_two_gigabytes(tmp_path, root):
    Image.new("RGB", (13000, 13000), (9, 8, 7)).save(tmp_path / "a.png")
    command = [sys.executable, "-c", DECODE, str(tmp_path / "a.png")]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    height, width, _, peak_kib = map(int, done.stdout.split())
    assert (height, width) == (13000, 13000)
    assert peak_kib < 2 * 2**20


# A tag's value that is cut short, of a strange type, and a list of tags in itself.
ODD_EXIF = {
    "none": b"garbage",
    "none after its mark": b"Exif\0\0garbage",
    "short": b"Exif\0\0II*\0\x08\0\0\0\xff\xff" + 3 * b"\x12\x01\3\0\1\0\0\0",
    "ratio": b"Exif\0\0MM\0*\0\0\0\x08\0\1\x01\x12\0\5\0\0\0\1\xff\xff\xff\xff",
    "ring": b"Exif\0\0II*\0\x08\0\0\0\1\0\x69\x87\4\0\1\0\0\0\x08\0\0\0",
}


@pytest.mark.parametrize("exif", ODD_EXIF.values(), ids=ODD_EXIF)
@pytest.mark.parametrize("suffix", ["jpg", "png", "webp", "heic"])
def test_a_photo_of_odd_exif_is_a_photo_of_any_kind(tmp_path, pixels, suffix, exif):
    """And Pillow says nothing: a warning would be an error here."""
    path = tmp_path / f"a.{suffix}"
    save(path, pixels, exif=exif)
    assert photos.head(path) == photos.Head((20, 12), 1, "")
    image, focal_px = photos.decode(path)
    assert image.shape == pixels.shape
    assert np.isnan(focal_px)


def test_what_can_be_read_of_exif_counts(tmp_path, pixels):
    """A broken part beside an orientation."""
    tags = struct.pack("<HHHII", 2, 0x0112, 3, 1, 6)
    tags += struct.pack("<HHII", 0x8769, 4, 1, 99_999)
    exif = b"Exif\0\0II*\0\x08\0\0\0" + tags
    save(tmp_path / "a.jpg", pixels, exif=exif)
    assert photos.head(tmp_path / "a.jpg").orientation == 6
    assert photos.decode(tmp_path / "a.jpg")[0].shape == (20, 12, 3)
