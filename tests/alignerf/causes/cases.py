"""Evidence of scenes with and without faults, and what a run has tried."""

import math

from alignerf import causes
from alignerf.causes import base
from alignerf.causes.shared import remedies
from alignerf.sfm import lens

# A scene in which nothing is wrong, as measured on courtyard.
WELL = base.Evidence(
    train_views=42,
    test_views=6,
    registered=48,
    total=48,
    photo_px=2.0,
    reprojection_px=0.2,
    flow_train_px=0.07,
    flow_test_px=0.09,
    camera_px=0.06,
    remainder_px=0.03,
    moved_fraction=0.0,
    psnr_train_db=28.7,
    psnr_test_db=27.2,
    overfit_px=0.09,
    epochs=0.8,
    detail_median=1.2,
    blurred_fraction=0.0,
    exposure_ev=0.005,
    shared_ev=0.04,
    shift_px=0.02,
    shift_errors=4.1,
    distortion_px=0.02,
    distortion_errors=1.3,
    photo_width_px=400.0,
    octaves=(1.0, 0.9, 0.97, 0.98, 1.0),
    tone_gain_ev=0.0,
    tone_gamma=1.0,
    tone_white_ev=0.0,
    transient_fraction=0.0,
    exchanged=4.0,
)
# Matches that find nothing to correct.
FINE = lens.Lens([], 1.0, 0.0, 0.0, 0.0, before_px=0.16, after_px=0.16)
MATCHES = base.Matches(
    accepted=False,
    applied=False,
    before_px=0.16,
    after_px=0.17,
    pose_error_px=math.nan,
    worst_px=math.nan,
    lens=FINE,
)


def with_lens(part, **changes):
    """Matches that another lens explains, and so does a bundle adjustment."""
    found = FINE._replace(changed=[part], before_px=0.8, **changes)
    return MATCHES._replace(
        accepted=True, before_px=0.8, after_px=0.2, pose_error_px=3.0, lens=found
    )


FAULTS = {
    "camera": {"flow_train_px": 1.2, "camera_px": 1.2},
    "motion": {"moved_fraction": 0.2},
    "sparse": {"flow_test_px": 2.0, "psnr_test_db": 17.0},
    "few_views": {"test_views": 2},
    "lens_shift": {"shift_px": 0.7, "shift_errors": 20.0},
    "lens_distortion": {"distortion_px": 0.8, "distortion_errors": 9.0},
    "blurred": {"blurred_fraction": 0.2},
    "exposure": {"exposure_ev": 0.2},
    "undertrained": {"epochs": 0.2499},
    "unregistered": {"registered": 20, "total": 45},
    "focal": {"matches": with_lens("focal", focal_ratio=1.02)},
    "rolling_shutter": {"matches": with_lens("shutter", shutter_px=4.0)},
    "copies": {"copies": 3},
    "transients": {"transient_fraction": 0.03},
}
# Of another program's renders alone.
OF_RENDERS = {
    "tone": {"tone_gain_ev": 0.33},
    "channels": {"exchanged": 0.6, "tone_white_ev": 0.8},
    "half_size": {"octaves": (0.1, 0.7, 0.97, 0.98, 1.0)},
    "floaters": {"hidden_views": 9},
    "undertrained_renders": {"octaves": (0.2, 0.2, 0.3, 0.5, 0.7)},
}
# What a training that is too short does not tell.
BY_FLOW = {"camera", "motion", "sparse", "lens_shift", "lens_distortion"}
BY_FLOW |= {"blurred", "exposure", "transients"}
# Crops of a capture whose poses are wrong, at the photos' own size; and are right.
APART = base.Crops(
    places=2,
    px=160,
    photos=18,
    test_photos=6,
    flow_px=0.72,
    low_px=0.6,
    high_px=0.9,
    flow_test_px=1.64,
    camera_px=0.68,
    remainder_px=0.17,
    epochs=1.1,
)
TOGETHER = APART._replace(
    flow_px=0.2, low_px=0.15, high_px=0.25, flow_test_px=0.4, camera_px=0.1
)
THUMBNAIL = {"photo_px": 15.0, "photo_width_px": 4000.0}
JUDGED = base.ExternalRenders("given", "COLMAP's model", "named like the photos")
THEIRS = WELL._replace(judged=JUDGED, epochs=math.nan, reprojection_px=math.nan)
GAIN = remedies.Gain(
    name="aligned",
    db=0.6,
    low=0.3,
    high=0.9,
    minutes=4.0,
    method="aligned",
    in_loop=True,
)


def with_faults(*names, e=WELL, **changes):
    """Evidence with the faults of these names, and other changes."""
    for name in names:
        e = e._replace(**FAULTS[name])
    return e._replace(**changes)


def named(e):
    """The names of the causes, in their order."""
    return [finding.cause.name for finding in causes.find(e)]
