"""The scene moved between photos: pixels that do not move with their camera."""

from alignerf.causes import base, remedies

# Pixels that do not move with their camera: by so much at least, and by so much of what
# it moves, since a model that averages wrong poses is bent; and their share. That is up
# to 0.052 where nothing is wrong, and 0.17 where patches move by 5 px of the photo.
MOVED_PX, MOVED_OF_CAMERA, MOVED_FRACTION = 0.5, 0.7, 0.07
# What a model that is bent or blurred by another cause does not come to.
MOVED_ANYWAY = 0.25
# In dB on courtyard where objects alone move, over plain training of the same seconds
# (docs/measured/remedies.csv) and of as many steps (remedies_steps.csv).
WARPED_MOTION_DB, WARPED_MOTION_TWICE_DB = 0.2, -1.8


def advise(e, gains):
    """Nothing where photos were warped in vain."""
    if remedies.warped_in_vain(e, gains):
        return None
    return remedies.advise(e, gains) or (
        "train longer, then warp the photos once (rounds: 1). Where only objects move "
        f"in the demo's scene, warping brought {WARPED_MOTION_DB} dB at as many steps, "
        f"and lost {-WARPED_MOTION_TWICE_DB} dB to a training as long as both."
    )


CAUSE = base.Cause(
    name="motion",
    page="howto/fix.md#something-moved",
    order=(2, 11, 7),
    label="things that moved",
    unit="%",
    scale=lambda e: 100,
    value=lambda e: e.moved_fraction,
    limit=lambda e: MOVED_FRACTION,
    stands=lambda e: e.moved_fraction > MOVED_ANYWAY,
    called="things {probably}moved",
    sentence="Things {probably}moved between photos: {value:.0f} % of a photo moves "
    "independently of the camera.",
    advice=advise,
    advice_external="leave out the photos in which things moved, or train on warped "
    "ones, which `{export}` writes.",
)
