"""Which views are held out: of few photos enough for an interval, else every eighth."""

import numpy as np
import pytest

from alignerf import poses
from alignerf.captures import base
from alignerf.causes.shared import misalignment
from alignerf.experiment import check
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.scenes import prepare


def every(views, source="photos", **given):
    """The n of a scene that says what is given."""
    scene = scene_of(source, **given)
    return base.of(scene).every_of(scene, views)


def scene_of(source, **given):
    renders = {"external_renders": {"renders": "some"}}
    given |= renders if source == "external_renders" else {}
    return of_scenes.checked({"source": source, "path": "somewhere", **given})


@pytest.mark.parametrize("views", range(3, 61))
@pytest.mark.parametrize("source", ["photos", "transforms", "courtyard"])
def test_views_are_held_out_as_seldom_as_an_interval_allows(views, source):
    n = every(views, source)
    split = prepare.split_views(views, test_every=n)
    held_out = np.sum(split == "test")
    if views < 17:
        assert n == 8
        return
    assert held_out >= misalignment.FEW_TEST_VIEWS
    assert views - held_out >= misalignment.FEW_TRAIN_VIEWS
    assert 4 <= n <= 8
    assert n == 8 or -(-views // (n + 1)) < misalignment.FEW_TEST_VIEWS
    assert views < 33 or n == 8


def test_of_24_photos_five_are_held_out():
    split = poses.split_of(named(24), scene_of("photos"))
    assert np.flatnonzero(split == "test").tolist() == [0, 5, 10, 15, 20]


@pytest.mark.parametrize("source", ["llff", "mipnerf360"])
def test_published_scenes_keep_every_eighth_unless_auto_is_asked_for(source):
    assert [every(views, source) for views in (20, 24, 60)] == [8, 8, 8]
    assert every(24, source, test_every="auto") == 5


@pytest.mark.parametrize("n", [2, 5, 8, 100])
def test_a_number_holds(n):
    for source, record in base.every().items():
        if record.says_split:
            continue
        assert every(24, source, test_every=n) == n


def test_enough_is_what_the_verdict_calls_enough():
    assert base.MIN_TEST_VIEWS == misalignment.FEW_TEST_VIEWS


def test_what_a_file_says_itself_is_kept_and_a_number_beside_it_is_told(caplog):
    views = named(3)._replace(split=np.array(["train", "test", "train"]))
    for given, told in ((None, 0), (8, 1), ("auto", 1)):
        caplog.clear()
        split = poses.split_of(views, scene_of("transforms", test_every=given))
        assert split.tolist() == views.split.tolist()
        assert len(caplog.messages) == told


@pytest.mark.parametrize("word", ["often", 1, 0, -3, 2.5, True])
def test_what_it_cannot_be_is_refused(word):
    scene = {"source": "courtyard", "test_every": word}
    with pytest.raises(ValueError, match=r"scenes\.a\.test_every: "):
        check.checked({"scenes": {"a": scene}})


def named(views):
    """Views of which only names count."""
    return prepare.PosedViews(
        names=[f"{i:02d}" for i in range(views)],
        photos=[],
        pixtocams=None,
        camtoworlds=None,
        width=4,
        height=3,
    )
