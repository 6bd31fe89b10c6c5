"""Blur matching: the photo as blurred as the render, for the flow only.

Notation: images [h, w, 3] uint8 RGB; `sigma_px` standard deviation of a Gaussian
blur; `flow_px` [h, w, 2] from render to photo.
"""

import cv2
import numpy as np

from flow.warping import warp

# A render of a misaligned scene is rarely blurrier than 3 pixels; finer steps than
# a quarter of a pixel did not change the flow.
SIGMAS_PX = (0.0, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)


def match(photo, render, first_px):
    """The photo [h, w, 3] as blurred as the render, and the blur's sigma_px.

    first_px: a first flow. sigma minimises the squared difference of luminance
    between the render and the blurred photo *after* that flow has aligned them:
    without it the misalignment itself would be taken for blur. One sigma for the
    image: a map of it, smooth over 12 to 48 px, changed the flow's error on renders
    of a trained model by less than 1 %, mostly for the worse.
    """
    aligned = cv2.cvtColor(warp.warp(photo, first_px), cv2.COLOR_RGB2GRAY)
    target = cv2.cvtColor(np.ascontiguousarray(render), cv2.COLOR_RGB2GRAY)
    target = target.astype(np.float32)
    inside = warp.in_frame(first_px)
    residuals = [
        np.square(blur(aligned, sigma_px) - target)[inside].mean()
        if inside.any()
        else 0.0
        for sigma_px in SIGMAS_PX
    ]
    sigma_px = SIGMAS_PX[int(np.argmin(residuals))]
    return blur(photo, sigma_px), sigma_px


def blur(image, sigma_px):
    """The image after a Gaussian of sigma_px; at 0 the image itself."""
    return cv2.GaussianBlur(image, (0, 0), sigma_px) if sigma_px > 0 else image
