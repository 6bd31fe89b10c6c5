"""README.txt of an export: what lies there, where its cameras, photos and points come
from, and the commands of other programs.
"""

import textwrap
from pathlib import Path

import numpy as np

from alignerf.exports import formats
from alignerf.io import faults
from alignerf.scenes import prepared

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
Pixel centers are at +0.5 in both.

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

It turns, centers and scales the cameras. To keep their frame, add to either:

    nerfstudio-data --orientation-method none --center-method none \\
        --auto-scale-poses False

gsplat, in its checkout:

    python examples/simple_trainer.py default --data_dir PATH_OF_THIS_FOLDER \\
        --data_factor 1 --save_ply --disable_viewer

Gaussian splatting (graphdeco-inria), in its checkout; `-r 1` keeps photos that are
wider than 1600 pixels at their size:

    python train.py -s PATH_OF_THIS_FOLDER --eval -r 1

{every}

OpenSplat and Brush, which learn from all photos unless told otherwise:

    opensplat PATH_OF_THIS_FOLDER -n 30000 -o splat.ply
    brush PATH_OF_THIS_FOLDER

Postshot: drop images/ and sparse/0 into it together.

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
WIDTH, MAX_NAMED = 88, 50
# A principal point nearer to the photo's middle is in it, for all that one can see.
MIDDLE_PX = 0.5
# Every so many photos, by name, gsplat and Gaussian splatting hold out.
THEIR_TEST_EVERY = 8
DID_NOT_PAY = (
    "{method} did not show in this run that it brings more than chance, or too few "
    "photos are held out to tell"
)
# Source of a scene -> whose frame its cameras have.
FRAMES = {
    "photos": "COLMAP's: its unit of length is arbitrary",
    "courtyard": "the courtyard's, in meters",
}
FILES = {
    "images": "the photos, <view>.png, 8-bit RGB",
    formats.MASK.rpartition("/")[0]: "<view>.png.png: black pixels do not count",
    "transforms.json": "cameras and split, for nerfstudio and instant-ngp",
    "sparse": "sparse/0: cameras, poses and points, for COLMAP, gsplat and others",
    formats.POINTS: "points",
}


def text(folder, args, arrays, chosen, of_points, *, paid):
    """The content of README.txt. folder: of the export, with all other files in it.

    args: of the command line. arrays: of its cameras.npz. chosen: a
    `alignerf.export.Chosen`. of_points: how the points came about.
    """
    report = Path(args.scene) / "poses.json"
    poses = prepared.read_poses(args.scene, prepared.MORE) if report.is_file() else {}
    source = poses.get("source")
    if poses.get("poses") == "colmap" and source != "courtyard":
        source = "photos"
    files = {name: what for name, what in FILES.items() if (folder / name).exists()}
    if formats.POINTS in files:
        files[formats.POINTS] = f"points, as in sparse/0: {of_points}"
    names, split = arrays["names"], arrays["split"]
    test = sorted(names[split == "test"].tolist())
    wide = max(map(len, files))
    title = f"Photos and cameras of {faults.resolved(args.scene).name}"
    return TEXT.format(
        title=title,
        rule="=" * len(title),
        views=len(names),
        width=int(arrays["width"]),
        height=int(arrays["height"]),
        train=len(names) - len(test),
        test=len(test),
        test_names=", ".join(test) or "none",
        size=of_size(args.scene, chosen, poses),
        left_out=of_left_out(poses.get("left_out") or []),
        cameras=of_cameras(args, chosen, poses, paid=paid),
        held_out=of_held_out(chosen),
        frame=FRAMES.get(source, "that of the files that they came in"),
        files="\n".join(f"{name:{wide}}  {what}" for name, what in files.items()),
        every=of_their_split(names.tolist(), test) + of_middle(arrays),
        masks=OF_MASKS * ("masks" in files) + NO_POINTS * (formats.POINTS not in files),
    )


def of_size(scene, chosen, poses):
    """A sentence on the photos: size, and whether they are warped."""
    own = prepared.read_cameras(Path(scene) / "cameras.npz")
    what = (
        "The renders have" if poses.get("external_renders") else "This run trained on"
    )
    trained = f"{what} {own['width']}x{own['height']} pixels."
    if chosen.unknown:
        trained += (
            "\nPhotos have that size here too: how they were warped is not on disk."
        )
    if not chosen.warped:
        return f"{trained}\nPhotos are as taken."
    return (
        f"{trained}\nPhotos to learn from are warped onto the renders of a training; "
        "held-out photos\nare as taken. masks/ says where the warp holds."
    )


def of_cameras(args, chosen, poses, *, paid):
    """A sentence on whether cameras are corrected, and why not."""
    told = prepared.adjustment_of(poses)
    by_px, named = "", ""
    if told.get("accepted"):
        by_px = f"by {told['pose_error_px']:.1f} px of the photo"
        faults = poses["camera_check"].get("faults") or []
        named = "".join(f"\n* {fault['said']}" for fault in faults)
    if chosen.adjusted:
        return (
            f"Cameras are corrected by bundle adjustment, {by_px} in the median.{named}"
        )
    own, further = "Cameras are as given", "not corrected"
    if by_px and poses.get("poses") == "adjusted":
        own = f"Cameras were corrected before training, {by_px} in the median"
        further = "and not corrected further"
    if not paid:
        why = DID_NOT_PAY.format(method=args.if_pays[1])
        return f"{own}, {further}: {why}."
    if not chosen.corrected:
        if not args.cameras:
            return f"{own}."
        return (
            "Cameras of photos to learn from are as given: this run looked at them, "
            "and moved\nnone."
        )
    return "Cameras of photos to learn from are corrected by this run."


def of_held_out(chosen):
    """A sentence on the cameras of held-out views."""
    if chosen.adjusted or not chosen.moved:
        return "So are those of held-out photos."
    if not chosen.fitted:
        return (
            "Those of held-out photos are as given: no training has moved them, so "
            "scores by\nthem are lower than the scene's worth."
        )
    return (
        f'Those of {len(chosen.fitted)} held-out photos are "{formats.FITTED}" (so '
        "marked in\ntransforms.json). A score by them is fair to the scene, not to the "
        "cameras."
    )


def of_left_out(names):
    """A sentence on the photos that are not here; none where all are."""
    if not names:
        return ""
    said = f"Left out of the capture's photos ({len(names)}): "
    more = f" and {len(names) - MAX_NAMED} more" * (len(names) > MAX_NAMED)
    named = ", ".join(sorted(names)[:MAX_NAMED])
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
