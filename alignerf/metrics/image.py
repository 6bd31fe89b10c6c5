"""Image metrics as the field computes them, on 8-bit predictions.

Images are [h, w, 3] uint8; valid [h, w] says which pixels count. PSNR and SSIM
are of pixels that count alone; a filled image lets window-based metrics ignore
the rest. DESIGN: PSNR per view, then mean over views, then over scenes.
"""

import cv2
import numpy as np
from skimage import metrics as skimage_metrics

SSIM_WINDOW_PX = 11
# Fine detail is measured on luminance, after so much blur that noise does not count.
DETAIL_SIGMA_PX = 0.7
# Second differences along the rows, the columns and both diagonals.
SECOND = np.zeros((4, 3, 3), np.float32)
SECOND[:, 1, 1] = -2
SECOND[0, 1, ::2] = SECOND[1, ::2, 1] = SECOND[2, [0, 2], [0, 2]] = 1
SECOND[3, [0, 2], [2, 0]] = 1


def fill_invalid(target, render, valid):
    """The target with the render's own pixels where it is not valid."""
    return np.where(valid[..., None], target, render)


def psnr_db(target, render, valid):
    """Peak signal-to-noise ratio in dB over valid pixels; inf where identical.

    Raises ValueError where no pixel is valid.
    """
    if not valid.any():
        raise ValueError("no valid pixel")
    difference = target[valid].astype(np.float64) - render[valid]
    mse = np.mean(difference**2) / 255.0**2
    return np.inf if mse == 0 else -10.0 * np.log10(mse)


def ssim(target, render, valid):
    """Structural similarity, 11 x 11 Gaussian window of sigma 1.5, valid region.

    Per channel, k1 0.01, k2 0.03 (Wang et al. 2004). Invalid pixels of the target
    are filled by the render's and not averaged. Raises ValueError for images
    under 11 pixels, or where no whole window's centre is valid.
    """
    if min(target.shape[:2]) < SSIM_WINDOW_PX:
        raise ValueError(f"SSIM of {target.shape[:2]} pixels: under {SSIM_WINDOW_PX}")
    _, per_pixel = skimage_metrics.structural_similarity(
        fill_invalid(target, render, valid) / 255.0,
        render / 255.0,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        data_range=1.0,
        channel_axis=2,
        full=True,
    )
    border = SSIM_WINDOW_PX // 2
    inner = (slice(border, -border),) * 2
    if not valid[inner].any():
        raise ValueError("no valid pixel away from the border")
    return float(per_pixel[inner][valid[inner]].mean())


def learned(paths):
    """{"lpips_<network>": (target, render, valid) to its LPIPS}, of {network: weights}.

    Those without a file are left out. Raises ValueError naming the file.
    """
    return {f"lpips_{net}": _lpips(net, path) for net, path in paths.items() if path}


def _lpips(net, path):
    # JAX takes longer to import than all other scores to calculate.
    import jax.numpy as jnp

    from alignerf.metrics import lpips

    weights = lpips.read(net, path)

    def metric(target, render, valid):
        pair = (fill_invalid(target, render, valid), render)
        pair = [jnp.asarray(image[None] / 255.0, jnp.float32) for image in pair]
        return float(lpips.distance(net, weights, *pair)[0])

    return metric


def smooth(image):
    """The luminance [h, w] float32, slightly blurred."""
    grey = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    return cv2.GaussianBlur(grey.astype(np.float32), (0, 0), DETAIL_SIGMA_PX)


def least_detail(image, other):
    """Fine detail over another image's in the direction of four in which it is least.

    A camera that moves along a line while it takes a photo blurs it along that alone.
    """
    own, others = (
        [np.sqrt(np.mean(cv2.filter2D(grey, -1, kernel) ** 2)) for kernel in SECOND]
        for grey in map(smooth, (image, other))
    )
    return float(np.min(np.array(own) / np.maximum(others, 1e-6)))
