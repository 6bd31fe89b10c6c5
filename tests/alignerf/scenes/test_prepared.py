"""A prepared scene folder: read whole, and what is wrong with it named."""

from types import SimpleNamespace

import jax
import numpy as np
import pytest
from PIL import Image

from alignerf.scenes import cameras, prepared

WIDTH, HEIGHT = 20, 12
NAMES = ["a", "b c", "d", "e"]


@pytest.fixture
def arrays(rng):
    poses = np.stack(
        [np.linalg.qr(rng.normal(size=(3, 3)))[0] * [1, 1, 1] for _ in NAMES]
    )
    poses *= np.sign(np.linalg.det(poses))[:, None, None]
    centres = 5 + 3 * rng.normal(size=(len(NAMES), 3, 1))
    return {
        "pixtocams": np.stack([cameras.intrinsics(30.0, WIDTH, HEIGHT)] * len(NAMES)),
        "camtoworlds": np.concatenate([poses, centres], axis=-1),
        "names": np.array(NAMES),
        "width": WIDTH,
        "height": HEIGHT,
        "split": np.array(["test", "train", "train", "test"]),
    }


@pytest.fixture
def folder(tmp_path, rng, arrays):
    np.savez(tmp_path / "cameras.npz", **arrays)
    for name in ("images", "flow"):
        (tmp_path / name).mkdir()
    for name in NAMES:
        image = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        Image.fromarray(image).save(tmp_path / "images" / f"{name}.png")
        valid = rng.uniform(size=(HEIGHT, WIDTH)) < 0.5
        np.savez(tmp_path / "flow" / f"{name}.npz", flow_px=np.zeros(2), valid=valid)
    return tmp_path


def test_a_scene_is_read_and_normalised(folder, arrays):
    loaded = prepared.load(folder)
    assert loaded.names == NAMES
    assert (loaded.width, loaded.height) == (WIDTH, HEIGHT)
    np.testing.assert_array_equal(loaded.pixtocams, arrays["pixtocams"])
    centres = loaded.camtoworlds[:, :, 3]
    np.testing.assert_allclose(centres.mean(axis=0), 0, atol=1e-9)
    assert np.abs(centres).max() == pytest.approx(1)
    # A similarity: distances between cameras keep their ratios.
    given = arrays["camtoworlds"][:, :, 3]
    ratios = [
        np.linalg.norm(centres[i] - centres[j]) / np.linalg.norm(given[i] - given[j])
        for i in range(4)
        for j in range(i)
    ]
    assert np.ptp(ratios) < 1e-9
    assert list(loaded.views("train")) == [1, 2]
    assert list(loaded.views("test")) == [0, 3]


def test_images_and_masks_come_in_the_order_of_the_views(folder):
    loaded = prepared.load(folder)
    views = [2, 0]
    images = prepared.read_images(loaded, views, folder / "images")
    masks = prepared.read_validity(loaded, views, folder / "flow")
    assert images.dtype == np.uint8
    assert masks.dtype == bool
    for image, mask, view in zip(images, masks, views, strict=True):
        with Image.open(folder / "images" / f"{NAMES[view]}.png") as stored:
            np.testing.assert_array_equal(image, np.asarray(stored))
        with np.load(folder / "flow" / f"{NAMES[view]}.npz") as stored:
            np.testing.assert_array_equal(mask, stored["valid"])


def test_images_are_taken_by_jax_without_a_copy(folder):
    loaded = prepared.load(folder)
    for views in ([0], [1, 3, 2], [0, 1, 2, 3]):
        images = prepared.read_images(loaded, views, folder / "images")
        placed = jax.device_put(images)
        assert placed.unsafe_buffer_pointer() == images.ctypes.data
        assert jax.device_get(placed).ctypes.data == images.ctypes.data


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"names": None}, "no array names"),
        ({"width": None, "split": None}, "no array split, width"),
        ({"pixtocams": np.zeros((3, 3, 3))}, r"pixtocams is float64 \[3, 3, 3\]"),
        ({"split": np.array(["train", "test", "val", "test"])}, "split holds 'val'"),
        ({"names": np.array(NAMES, dtype=object)}, "not the .npz"),
    ],
)
def test_bad_cameras_are_named(folder, arrays, changes, reason):
    changed = {k: v for k, v in (arrays | changes).items() if v is not None}
    np.savez(folder / "cameras.npz", allow_pickle=True, **changed)
    with pytest.raises(ValueError, match=reason) as error:
        prepared.load(folder)
    assert str(folder / "cameras.npz") in str(error.value)


UNSEEING = ": no lens has such|is not a rotation"


@pytest.mark.parametrize("key", ["pixtocams", "camtoworlds"])
@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (lambda m: m * np.nan, "is not finite"),
        (lambda m: m - np.inf, "is not finite"),
        (lambda m: m * 1e30, ": no lens|is not finite"),
        # All rays, all rays of one pixel, or rays of all rows have no direction.
        (lambda m: m * 0, UNSEEING),
        (lambda m: m * [[1], [0], [1]], UNSEEING),
        (lambda m: m[:, [0, 0, *range(2, m.shape[1])]], UNSEEING),
        (lambda m: -m, UNSEEING),
        (lambda m: m * [[1], [1], [-1]], UNSEEING),
    ],
)
def test_a_camera_that_sees_nothing_is_named(folder, arrays, key, fault, reason):
    arrays[key][1] = fault(arrays[key][1])
    np.savez(folder / "cameras.npz", **arrays)
    with pytest.raises(
        ValueError, match=f"cameras.npz: {key} of view 'b c' ?({reason})"
    ):
        prepared.load(folder)


@pytest.mark.parametrize("x_px", [1e308, -1e6, 1e4])
def test_a_principal_point_far_outside_is_named(folder, arrays, x_px):
    camtopix = np.linalg.inv(cameras.intrinsics(30.0, WIDTH, HEIGHT))
    camtopix[0, 2] = x_px
    arrays["pixtocams"][2] = [[1 / 30, 0, -x_px / 30], *np.linalg.inv(camtopix)[1:]]
    np.savez(folder / "cameras.npz", **arrays)
    with pytest.raises(ValueError, match=r"cameras\.npz: pixtocams of view"):
        prepared.load(folder)


@pytest.mark.parametrize(
    ("name", "fits"),
    [
        ("=cmd|' C calc'!A0", False),
        ("=1+1", False),
        ("\uff1dcmd", False),
        ("@SUM(1)", False),
        ("-2+3+cmd|' C calc'!A0", False),
        ('+HYPERLINK("a")', False),
        ("-1", True),
        ("+ 2", True),
        ("@home", True),
        ("a=1", True),
        ("IMG (2)", True),
    ],
)
def test_a_formula_of_a_spreadsheet_is_no_name(name, fits):
    assert prepared.is_name(name) == fits


@pytest.mark.parametrize(
    "name", ["../x", "a/b", "/tmp/x", "", ".hidden", "a\0b", "a\nb", "x" * 300, "a\\b"]
)
def test_a_name_that_leads_elsewhere_is_refused(folder, arrays, name):
    arrays["names"] = np.array([name, *NAMES[1:]])
    np.savez(folder / "cameras.npz", **arrays)
    with pytest.raises(ValueError, match=r"cameras.npz: .* cannot be a view's name"):
        prepared.load(folder)


@pytest.mark.parametrize(
    "name", ["Screenshot at 10.00.00\u202fPM", "é 写 (2)", "-rf", "$(x)", "a\u00a0b"]
)
def test_names_that_people_have_are_taken(folder, arrays, name):
    arrays["names"] = np.array([name, *NAMES[1:]])
    np.savez(folder / "cameras.npz", **arrays)
    assert prepared.load(folder).names[0] == name


def test_two_views_of_one_name_are_refused(folder, arrays):
    arrays["names"] = np.array([NAMES[1], *NAMES[1:]])
    np.savez(folder / "cameras.npz", **arrays)
    with pytest.raises(ValueError, match=r"cameras.npz: two views have the name"):
        prepared.load(folder)


@pytest.mark.parametrize(
    "changes",
    [
        {"pixtocams": np.full((4, 3, 3), "x")},
        {"pixtocams": np.full((4, 3, 3), 1j)},
        {"width": np.array("9")},
        {"width": np.array(10**9)},
        {"height": np.array(0)},
        {"split": np.array(["train"])},
        {"names": np.arange(4)},
    ],
)
def test_arrays_of_another_kind_are_refused(folder, arrays, changes):
    np.savez(folder / "cameras.npz", **arrays | changes)
    with pytest.raises(ValueError, match=r"cameras.npz: "):
        prepared.load(folder)


@pytest.mark.parametrize("focal_px", [1e-3, 1.0, 1e5])
def test_cameras_of_any_focal_length_are_taken(folder, arrays, focal_px):
    arrays["pixtocams"][:] = cameras.intrinsics(focal_px, WIDTH, HEIGHT)
    np.savez(folder / "cameras.npz", **arrays)
    prepared.load(folder)


@pytest.mark.parametrize("damage", ["missing", "empty", "cut", "text", "flipped"])
def test_damaged_cameras_are_named(folder, damage):
    path = folder / "cameras.npz"
    data = bytearray(path.read_bytes())
    path.unlink()
    if damage == "flipped":
        data[len(data) // 3] ^= 255
    content = {"empty": b"", "cut": data[:200], "text": b"no", "flipped": data}
    if damage != "missing":
        path.write_bytes(content[damage])
    with pytest.raises((ValueError, OSError)) as error:
        prepared.load(folder)
    assert str(path) in str(error.value)


def test_a_split_without_views_is_an_error(folder, arrays):
    np.savez(folder / "cameras.npz", **arrays | {"split": np.array(["train"] * 4)})
    with pytest.raises(ValueError, match=r"cameras\.npz: no test view"):
        prepared.load(folder).views("test")


@pytest.mark.parametrize("damage", ["missing", "empty", "cut", "size", "key"])
def test_bad_masks_are_named(folder, damage):
    path = folder / "flow" / "b c.npz"
    if damage == "missing":
        path.unlink()
    elif damage == "key":
        np.savez(path, flow_px=np.zeros(2))
    elif damage == "size":
        np.savez(path, valid=np.ones((3, 4), bool))
    else:
        path.write_bytes(path.read_bytes()[: {"empty": 0, "cut": 300}[damage]])
    with pytest.raises((ValueError, OSError)) as error:
        prepared.read_validity(prepared.load(folder), [0, 1], folder / "flow")
    assert "flow/b c.npz" in str(error.value)


def at_places(places):
    """Views that look along one axis from these places [n, 3]."""
    poses = np.tile(np.eye(4)[:3], (len(places), 1, 1))
    poses[:, :, 3] = places
    names = [f"v{number}" for number in range(len(places))]
    return SimpleNamespace(names=names, camtoworlds=poses)


def ring(rng):
    """Places of 20 cameras about a metre from the origin."""
    return rng.normal(size=(20, 3))


def moved(places, view, far):
    places[view] += far
    return places


ONE, FAR = "stand at one place", "so far from the origin"


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda places: 0 * places, ONE),
        (lambda places: 0 * places + 7.0, ONE),
        (lambda places: 1e-10 * places, ONE),
        (lambda places: places + 1e15, FAR),
        (lambda places: 1e3 * places + 1e18, "(one place|far from the origin)"),
        # Rounded by whoever has written them.
        (lambda places: (places + 6.4e6).astype(np.float32).astype(float), FAR),
        (lambda places: moved(places, 3, 1e12), "v3 stands .* as far away"),
        (lambda places: moved(places, 19, 1e6), "v19 stands .* as far away"),
    ],
)
def test_places_of_which_nothing_is_left_are_refused(rng, change, reason):
    with pytest.raises(ValueError, match=f"HERE: .*{reason}"):
        prepared.check_places("HERE", at_places(change(ring(rng))))


@pytest.mark.parametrize(
    "change",
    [
        lambda places: places,
        lambda places: 1e-6 * places,
        lambda places: 1e9 * places,
        # In metres from the middle of the earth, or of a country's grid.
        lambda places: places + np.array([4.3e6, -2.1e6, 4.1e6]),
        lambda places: places.astype(np.float32).astype(float),
        # Most from one tripod.
        lambda places: np.concatenate([np.zeros((30, 3)), places]),
        lambda places: places[:1],
        lambda places: places[:2],
    ],
)
def test_places_as_people_have_them_are_taken_without_a_word(rng, change, caplog):
    prepared.check_places("HERE", at_places(change(ring(rng))))
    assert not caplog.text


def test_a_camera_far_from_the_others_is_named(rng, caplog):
    prepared.check_places("HERE", at_places(moved(ring(rng), 5, 1e4)))
    assert "HERE: the camera of v5 stands" in caplog.text
