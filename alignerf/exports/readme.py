"""README.txt of an export: what lies there, and the commands of other programs."""

import textwrap
from typing import NamedTuple

import numpy as np

TEXT = """\
{title}
{rule}

{views} photos of {width}x{height} pixels, undistorted:
{train} to learn from, {test} held out.
{size}{left_out}

Cameras
-------

{cameras}
{held_out}
Held out: {test_names}

Pinholes, one focal length for each axis. Poses are in the frame of the scene's own
cameras ({frame}).
transforms.json: camera to world, axes as in OpenGL (x right, y up, z backwards).
sparse/0: world to camera, axes as in COLMAP (x right, y down, z forwards).
Pixel centres are at +0.5 in both.

Files
-----

{files}

Programs
--------

All commands are run in this folder, or name it. What they write here stays when the
export is made anew: .why-blurry lists what is replaced.

nerfstudio (learns from train_filenames, judges by test_filenames):

    ns-train splatfacto --data .
    ns-train nerfacto --data . --pipeline.model.camera-optimizer.mode off

It turns, centres and scales the cameras. To keep their frame, add to either:

    nerfstudio-data --orientation-method none --center-method none \\
        --auto-scale-poses False

gsplat, in its checkout:

    python examples/simple_trainer.py default --data_dir PATH_OF_THIS_FOLDER \\
        --data_factor 1

Gaussian splatting (graphdeco-inria), in its checkout; `-r 1` keeps photos that are
wider than 1600 pixels at their size:

    python train.py -s PATH_OF_THIS_FOLDER --eval -r 1

{every}

COLMAP:

    colmap gui --import_path sparse/0 --image_path images
    colmap model_analyzer --path sparse/0
{masks}"""
OF_MASKS = """
Masks are known to nerfstudio by transforms.json, and to COLMAP by its own names:

    colmap feature_extractor --database_path new.db --image_path images \\
        --ImageReader.mask_path masks

gsplat and Gaussian splatting do not read them.
"""
NO_POINTS = """
There are no points: the views share none. gsplat and Gaussian splatting need some, and
splatfacto begins with random ones.
"""
WIDTH, MOST_NAMED = 88, 50
# A principal point nearer to the photo's middle is in it, for all that one can see.
MIDDLE_PX = 0.5
# Every so many photos, by name, gsplat and Gaussian splatting hold out.
THEIR_TEST_EVERY = 8


class Told(NamedTuple):
    """What an export's README.txt says.

    title: of the export. arrays: of its cameras.npz. size, cameras, held_out, points:
    sentences. frame: whose it is. files: {path: what it is}. masked: whether there are
    masks. left_out: names of the capture's photos that are not among its views.
    """

    title: str
    arrays: dict
    size: str
    cameras: str
    held_out: str
    frame: str
    files: dict[str, str]
    masked: bool
    left_out: list[str]


def text(told: Told):
    """The content of README.txt."""
    names, split = told.arrays["names"], told.arrays["split"]
    test = sorted(names[split == "test"].tolist())
    width = max(map(len, told.files))
    more = OF_MASKS if told.masked else ""
    if "points.ply" not in told.files:
        more += NO_POINTS
    return TEXT.format(
        title=told.title,
        rule="=" * len(told.title),
        views=len(names),
        width=int(told.arrays["width"]),
        height=int(told.arrays["height"]),
        train=len(names) - len(test),
        test=len(test),
        test_names=", ".join(test) or "none",
        size=told.size,
        left_out=of_left_out(told.left_out),
        cameras=told.cameras,
        held_out=told.held_out,
        frame=told.frame,
        files="\n".join(f"{name:{width}}  {what}" for name, what in told.files.items()),
        every=of_their_split(names.tolist(), test) + of_middle(told.arrays),
        masks=more,
    )


def of_left_out(names):
    """A sentence on the photos that are not here; none where all are."""
    if not names:
        return ""
    said = f"Left out of the capture's photos ({len(names)}): "
    more = f" and {len(names) - MOST_NAMED} more" * (len(names) > MOST_NAMED)
    named = ", ".join(sorted(names)[:MOST_NAMED])
    return "\n" + textwrap.fill(f"{said}{named}{more}.", WIDTH)


def of_their_split(names, test):
    """Whether programs that hold out every 8th photo hold out the same ones."""
    # By file name, which is another order than that of the views.
    theirs = sorted(names, key="{}.png".format)[::THEIR_TEST_EVERY]
    if sorted(theirs) == test:
        return (
            f"Both hold out every {THEIR_TEST_EVERY}th photo by name, from the first: "
            "those that are\nheld out here."
        )
    return (
        f"Both hold out every {THEIR_TEST_EVERY}th photo by name, from the first: NOT "
        "those that are held out\nhere. sparse/0/test.txt has ours; newer versions of "
        "Gaussian splatting read it where\nllffhold is 0 (scene/dataset_readers.py)."
    )


def of_middle(arrays):
    """A warning where Gaussian splatting takes another principal point, or nothing."""
    middle = np.array([arrays["width"], arrays["height"]]) / 2
    away_px = np.abs(np.linalg.inv(arrays["pixtocams"])[:, :2, 2] - middle).max()
    if away_px < MIDDLE_PX:
        return ""
    return (
        "\nGaussian splatting takes the photo's middle for the principal point: here "
        f"that is up to\n{away_px:.1f} px from it. nerfstudio and gsplat read it."
    )
