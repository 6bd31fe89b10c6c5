"""What an export says of itself: where its cameras, photos and points come from."""

from pathlib import Path

from alignerf.exports import formats, readme
from alignerf.files import faults, json_files
from alignerf.scenes import prepared

DID_NOT_PAY = (
    "{method} did not show in this run that it brings more than chance, or too few "
    "photos are held out to tell"
)
# Source of a scene -> whose frame its cameras have.
FRAMES = {
    "photos": "COLMAP's: its unit of length is arbitrary",
    "courtyard": "the courtyard's, in metres",
}
FILES = {
    "images": "the photos, <view>.png, 8-bit RGB",
    formats.MASK.rpartition("/")[0]: "<view>.png.png: black pixels do not count",
    "transforms.json": "cameras and split, for nerfstudio and instant-ngp",
    "sparse": "sparse/0: cameras, poses and points, for COLMAP, gsplat and others",
    formats.POINTS: "points",
    "transforms_train.json": "as NeRF's synthetic scenes have it; _val and _test, too",
    "poses_bounds.npy": "as LLFF has it",
}


def told(folder, args, arrays, chosen, of_points, *, paid) -> readme.Told:
    """What README.txt says. folder: of the export, with all other files in it.

    args: of the command line. chosen: a `alignerf.export.Chosen`. of_points: how the
    points came about.
    """
    report = Path(args.scene) / "poses.json"
    poses = json_files.read(report) if report.is_file() else {}
    source = poses.get("source")
    if poses.get("poses") == "colmap" and source != "courtyard":
        source = "photos"
    files = {name: what for name, what in FILES.items() if (folder / name).exists()}
    if formats.POINTS in files:
        files[formats.POINTS] = f"points, as in sparse/0: {of_points}"
    return readme.Told(
        title=f"Photos and cameras of {faults.resolved(args.scene).name}",
        arrays=arrays,
        size=of_size(args.scene, arrays, chosen),
        cameras=of_cameras(args, chosen, poses, paid=paid),
        held_out=of_held_out(chosen),
        frame=FRAMES.get(source, "that of the files that they came in"),
        files=files,
        masked="masks" in files,
        left_out=[str(name) for name in poses.get("left_out") or []],
    )


def of_size(scene, arrays, chosen):
    """A sentence on the photos: size, and whether they are warped."""
    own = prepared.read_cameras(Path(scene) / "cameras.npz")
    report = Path(scene) / "poses.json"
    is_judged = report.is_file() and json_files.read(report).get("judged")
    what = "The renders have" if is_judged else "This run trained on"
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
    by_px = ""
    if told.get("accepted"):
        by_px = f"by {told['pose_error_px']:.1f} px of the photo"
    finer = prepared.keypoints_of(poses).get("accepted") is True
    by_patches = "; keypoints were aligned by patches" if finer else ""
    if chosen.adjusted:
        return (
            f"Cameras are corrected by bundle adjustment, {by_px} in the median"
            f"{by_patches}."
        )
    own, further = f"Cameras are as given{by_patches}", "not corrected"
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
