"""Pairs of a render and its photo: their files, the flow between them, its validity.

Notation: images [h, w, 3] uint8 RGB; `flow_px` [h, w, 2] float32 from render to
photo, x then y in pixels.
"""

from flow.estimation import estimate
from flow.warping import warp


def find_pairs(renders, photos):
    """[(view, render's path, photo's path)] of every render, in the order of names.

    renders, photos: folders of <view>.png. Raises ValueError naming the folder or the
    photo that is missing.
    """
    for folder in (renders, photos):
        if not folder.is_dir():
            raise ValueError(f"{folder}: no such folder")
    views = sorted(path.stem for path in renders.glob("*.png"))
    if not views:
        raise ValueError(f"{renders}: no renders (*.png) to align")
    pairs = [(v, renders / f"{v}.png", photos / f"{v}.png") for v in views]
    for _, render_path, photo_path in pairs:
        if not photo_path.is_file():
            raise ValueError(f"{photo_path}: no photo for render {render_path}")
    return pairs


def flow_and_validity(
    render,
    photo,
    *,
    method=estimate.DEFAULT,
    match_blur=True,
    blur_by=None,
    tolerance_px=1.0,
    back=None,
):
    """(flow_px [h, w, 2], valid [h, w], sigma_px of the photo's blur before the flow).

    Valid: in frame, where the flow and that from photo to render agree to
    tolerance_px. blur_by: as of `estimate.blur_match`. back: the estimator of the flow
    from photo to render, which only checks; None: the same.
    """
    sigma_px = 0.0
    if match_blur:
        photo, sigma_px = estimate.blur_match(
            photo, render, method=method, blur_by=blur_by
        )
    forward_px = estimate.estimate(render, photo, method=method)
    backward_px = estimate.estimate(photo, render, method=back or method)
    valid = warp.consistent(forward_px, backward_px, tolerance_px=tolerance_px)
    return forward_px, valid, sigma_px
