"""Where photos do not count: nothing is learnt, nothing scored, and it is handed on."""

import json

import numpy as np
import pytest

from alignerf import evaluate, export, testsets
from alignerf.readers import transforms
from alignerf.scenes import distortion, prepare, prepared
from alignerf.training import batches
from alignerf.verdict import views as verdict_views
from tools.bench import cases

WIDTH, HEIGHT = 48, 32
HIDDEN = 12


@pytest.fixture
def scene(tmp_path):
    """A prepared scene whose photos do not count in their first columns."""
    cases.write_scene(tmp_path / "scene", cases.orbit(width=WIDTH, height=HEIGHT))
    folder = tmp_path / "scene" / prepared.MASKS
    folder.mkdir()
    valid = np.ones((HEIGHT, WIDTH), bool)
    valid[:, :HIDDEN] = False
    for name in prepared.load(tmp_path / "scene").names:
        np.savez_compressed(folder / f"{name}.npz", valid=valid)
    return tmp_path / "scene"


def unpacked(views):
    return np.unpackbits(np.asarray(views.valid), axis=-1)[..., :WIDTH].astype(bool)


def test_hidden_pixels_teach_nothing_also_where_photos_are_warped(scene, tmp_path):
    loaded = prepared.load(scene)
    chosen = loaded.views("train")
    plain = batches.load_views(loaded, chosen, scene / "images")
    assert not unpacked(plain)[:, :, :HIDDEN].any()
    assert unpacked(plain)[:, :, HIDDEN:].all()
    (tmp_path / "flow").mkdir()
    valid = np.ones((HEIGHT, WIDTH), bool)
    valid[:5] = False
    for view in chosen:
        np.savez(tmp_path / "flow" / f"{loaded.names[view]}.npz", valid=valid)
    warped = batches.load_views(loaded, chosen, scene / "images", tmp_path / "flow")
    both = valid.copy()
    both[:, :HIDDEN] = False
    np.testing.assert_array_equal(unpacked(warped), np.stack([both] * len(chosen)))


def test_hidden_pixels_are_not_scored(scene):
    loaded = prepared.load(scene)
    view = loaded.views("test")[0]
    photo, mask = testsets.named("standard").make(evaluate.View(loaded, view))
    render = np.clip(photo.astype(int) + 20, 0, 255).astype(np.uint8)
    wrong = render.copy()
    wrong[:, :HIDDEN] = 255 - wrong[:, :HIDDEN]

    def psnr_db(image, mask):
        return evaluate.score(photo, image, mask, {})["psnr_db"]

    assert psnr_db(render, mask) == psnr_db(wrong, mask)
    everywhere = np.ones_like(mask)
    assert psnr_db(render, everywhere) > psnr_db(wrong, everywhere)
    right, found = (
        verdict_views.measured(photo, image, mask, mask) for image in (render, wrong)
    )
    assert right["psnr_db"] == found["psnr_db"]
    assert right["exposure_ev"] == found["exposure_ev"]


def test_a_mask_becomes_smaller_with_its_photo_and_keeps_no_mixed_pixel(tmp_path):
    """Of 9 columns hidden the third that a smaller pixel mixes is hidden too."""
    photo = np.zeros((60, 80, 3), np.uint8)
    mask = np.full_like(photo, 255)
    mask[:, :9] = 0
    views = prepare.PosedViews(
        names=["b", "a"],
        pixtocams=np.stack([np.eye(3)] * 2),
        camtoworlds=np.stack([np.eye(3, 4)] * 2),
        width=80,
        height=60,
        photos=[prepare.Photo(photo)] * 2,
        # Of `b` only: sorted by name, it comes second.
        masks=[prepare.Photo(mask), prepare.all_count(80, 60)],
    )
    views = prepare.downscale(prepare.sort_by_name(views), 1.25)
    prepare.write_views(tmp_path / "new", views, split=np.array(["train", "test"]))
    with np.load(tmp_path / "new/images/masks/b.npz") as archive:
        valid = archive["valid"]
    assert valid.shape == (48, 64)
    assert not valid[:, :8].any()
    assert valid[:, 8:].all()
    with np.load(tmp_path / "new/images/masks/a.npz") as archive:
        assert archive["valid"].all()


def test_a_mask_that_hides_all_is_refused_by_name(tmp_path):
    views = prepare.PosedViews(
        names=["a"],
        pixtocams=np.eye(3)[None],
        camtoworlds=np.eye(3, 4)[None],
        width=40,
        height=40,
        photos=[prepare.Photo(np.zeros((40, 40, 3), np.uint8))],
        masks=[prepare.Photo(np.zeros((40, 40, 3), np.uint8))],
    )
    with pytest.raises(ValueError, match="a: it leaves no pixel of the view a"):
        prepare.write_views(tmp_path / "new", views, split=np.array(["train"]))


def test_what_is_hidden_does_not_come_through_an_undistorted_edge():
    """A bright thing behind a mask, seen through a lens that bends."""
    photo = np.full((120, 160, 3), 60, np.uint8)
    photo[40:80, 60:100] = 255
    mask = np.full_like(photo, 255)
    mask[40:80, 60:100] = 0
    lens = np.array([[120.0, 0, 80], [0, 120, 60], [0, 0, 1]])
    views = distortion.pinhole_views(
        ["a"],
        [(lens, np.array([-0.1, 0.0, 0.0, 0.0, 0.0]))],
        np.eye(3, 4)[None],
        width=160,
        height=120,
        photos=[prepare.Photo(photo)],
        masks=[prepare.Photo(mask)],
        where="HERE",
    )
    valid = (views.masks[0].read() >= prepare.WHITE).all(axis=-1)
    assert valid.mean() > 0.7
    assert (views.photos[0].read()[valid] == 60).all()


def test_exported_masks_come_back_through_our_own_source(scene, tmp_path):
    out = tmp_path / "out"
    export.main(["--scene", str(scene), "--out", str(out)])
    views, _ = transforms.read(out)
    for i in range(len(views.names)):
        mask = views.masks[i].read()
        assert not mask[:, :HIDDEN].any()
        assert (mask[:, HIDDEN:] == 255).all()
    content = json.loads((out / "transforms.json").read_text())
    for wrong in ("masks/none.png", "../secret.png", 5):
        content["frames"][1]["mask_path"] = wrong
        (out / "transforms.json").write_text(json.dumps(content))
        with pytest.raises(ValueError, match=r"transforms\.json: .*(mask|leads out)"):
            transforms.read(out)
