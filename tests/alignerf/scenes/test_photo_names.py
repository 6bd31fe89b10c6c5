"""Photos by the names that files call them."""

import random

import pytest

from alignerf.scenes import photo_names


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("images/0001.jpg", "images/0001.jpg"),
        ("./images/0001.jpg", "images/0001.jpg"),
        (".\\images\\0001.jpg", "images/0001.jpg"),
        ("C:/Users/someone/scan/images/0001.jpg", "images/0001.jpg"),
        ("../data/0001.jpg", "images/0001.jpg"),
        ("images/0001", "images/0001.jpg"),
        ("IMAGES/0001.JPG", "images/0001.jpg"),
        ("images/a%20%C3%A4.jpg", "images/a ä.jpg"),
        ("0001.png", "images/0001.jpg"),
        ("0003.jpg", None),
        ("", None),
        ("images", None),
    ],
)
def test_a_name_means_the_photo_of_its_path_or_name(name, path):
    paths = [f"images/{one}.jpg" for one in ("0001", "0002", "a ä")]
    found = photo_names.match([name], paths)
    assert found.get(name) == path


def test_a_name_that_fits_two_photos_means_neither():
    paths = ["cam0/1.jpg", "cam1/1.jpg"]
    assert photo_names.match(["1.jpg"], paths) == {}
    assert photo_names.match(["x/1.jpg", "y/1.jpg"], ["1.jpg"]) == {}
    assert photo_names.match(["cam1/1.jpg", "1.jpg"], paths) == {
        "cam1/1.jpg": "cam1/1.jpg"
    }


def test_a_whole_path_goes_before_its_end():
    paths = ["a/1.jpg", "x/a/1.jpg"]
    assert photo_names.match(["a/1.jpg"], paths) == {"a/1.jpg": "a/1.jpg"}


def test_no_photo_is_taken_twice_nor_for_another():
    draw = random.Random(0)

    def some_path():
        folders = [draw.choice("ab") for _ in range(draw.randrange(3))]
        suffix = draw.choice([".jpg", ".JPG", ".png", ""])
        return "/".join([*folders, draw.choice(["1", "2", "I", "i"]) + suffix])

    for _ in range(3000):
        names = [some_path() for _ in range(draw.randrange(8))]
        paths = list({some_path() for _ in range(draw.randrange(8))})
        found = photo_names.match(names, paths)
        assert len(set(found.values())) == len(found)
        for name, path in found.items():
            own, other = (
                one.rpartition("/")[2].partition(".")[0].casefold()
                for one in (name, path)
            )
            assert path in paths
            assert own == other
            # Its own path, where there is one, is never passed over.
            assert path == name or name not in paths
        assert all(found[name] == name for name in names if name in paths)


def test_views_are_called_by_folders_where_stems_collide():
    paths = [
        "cam0/0001.jpg",
        "cam1/0001.jpg",
        "cam1/0002.jpg",
        "x/b/3.jpg",
        "y/b/3.jpg",
        "",
    ]
    assert list(photo_names.view_names(paths).values()) == [
        *("cam0_0001", "cam1_0001", "0002", "x_b_3", "y_b_3", "")
    ]


@pytest.mark.parametrize(
    ("photo", "other"),
    [
        ("frame-{:06d}.color.png", "frame-{:06d}.depth.png"),
        ("rgb_{}.png", "depth_{}.png"),
        ("frame{:06d}.jpg", "depth{:06d}.png"),
        ("IMG_{}.JPG", "IMG_{}_mask.png"),
        ("{:04d}.jpg", "Confidence_{:04d}.png"),
        ("{}_rgb.png", "{}_normals.png"),
        ("a{}.jpg", "a{}.semantic.png"),
    ],
)
def test_what_lies_beside_a_photo_of_its_name_is_none(photo, other, rng):
    numbers = rng.choice(1000, 20, replace=False)
    taken = [photo.format(number) for number in numbers]
    names = taken + [other.format(number) for number in numbers]
    rng.shuffle(names)
    assert sorted(photo_names.photos_of(names)) == sorted(taken)
    # Alone they are what the folder holds.
    alone = [other.format(number) for number in numbers]
    assert photo_names.photos_of([*alone, "1.json", "a2.txt"])[:20] == alone


def test_all_photos_below_a_folder_are_listed_but_masks_and_depths(tmp_path):
    for path in ("a/1.JPG", "2.png", "masks/2.png", "depth/2.png", ".h/3.png", "t.txt"):
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).touch()
    (tmp_path / "a/loop").symlink_to(tmp_path)
    assert photo_names.listed(tmp_path) == ["2.png", "a/1.JPG"]
