"""Corrected cameras, judged by matches that no correction has seen."""

from pathlib import Path

import numpy as np

from alignerf.files import json_files
from alignerf.scenes import prepared
from alignerf.sfm import acceptance, calibration, matches


def judged(scene, paths):
    """{method: acceptance.Judgement} of corrected cameras over the scene's own.

    scene: its folder; paths: {method: cameras.npz}. Empty where the scene has no
    matches. A view that a method has left where it was says nothing of it, so that
    matches count between two that it learnt from.
    """
    path = Path(scene) / matches.FILE
    if not (paths and path.is_file()):
        return {}
    found = matches.load(path)
    own = prepared.read_cameras(Path(scene) / "cameras.npz")
    poses = json_files.read(Path(scene) / "poses.json", prepared.POSES)
    if own["names"].tolist() != found.names:
        raise ValueError(f"{path}: not the matches of the views of {scene}")
    learnt = found.between(own["split"] == "train")
    photo_px = poses["photo_width"] / found.width
    before = cameras_of(own, found)
    return {
        name: acceptance.judge(
            learnt, before, cameras_of(prepared.read_cameras(cameras), found), photo_px
        )
        for name, cameras in paths.items()
    }


def cameras_of(arrays, found) -> calibration.Cameras:
    """The pinhole cameras of a cameras.npz, in px of matches."""
    ratios = found.width / arrays["width"], found.height / arrays["height"]
    lenses, none = np.linalg.inv(arrays["pixtocams"]), np.zeros((len(found.names), 5))
    return calibration.Cameras(lenses, arrays["camtoworlds"], none).scaled(ratios)
