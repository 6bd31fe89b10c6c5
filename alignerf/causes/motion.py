"""The scene moved between photos: pixels that do not move with their camera."""

from alignerf.causes import base, exposure
from alignerf.causes.shared import misalignment, remedies

# Pixels that do not move with their camera: by so much at least, and by so much of what
# it moves, since a model that averages wrong poses is bent; and their share. That is up
# to 0.052 where nothing is wrong, and 0.17 where patches move by 5 px of the photo.
MOVED_PX, MOVED_OF_CAMERA, MOVED_FRACTION = 0.5, 0.7, 0.07
# Renders of another tone seem to move so much more: leaves by 0.11.
TIMES_BY_TONE = 1.6
# What a model that is bent or blurred by another cause does not come to.
MOVED_ANYWAY = 0.25
# In dB on courtyard where objects alone move, over plain training of the same seconds
# (docs/measured/remedies.csv) and of as many steps (remedies_steps.csv).
WARPED_MOTION_DB, WARPED_MOTION_TWICE_DB = 0.2, -1.8


def find(e):
    """Pixels that move by themselves, or points that photos share and no cameras fit.

    No warping where photos were warped in vain.
    """
    advice = "" if e.judged else remedies.warped_in_vain(e) or remedies.advise(e)
    if misalignment.is_scattered(e):
        px, limit_px = misalignment.scatter_px(e), misalignment.scatter_limit_px(e)
        said = f"points that several photos show lie {base.length(px)} from where any "
        said += "cameras expect them"
        more = {"said": said, "unit": "px", "advice": advice, "stands": True}
        return base.beyond(px, limit_px, **more)
    tone = exposure.find_tone(e)
    times = TIMES_BY_TONE if tone and tone.sure is not None else 1
    percent = 100 * e.moved_fraction
    return base.beyond(
        percent,
        100 * times * MOVED_FRACTION,
        said=f"{percent:.0f} % of a photo moves independently of the camera",
        stands=e.moved_fraction > MOVED_ANYWAY,
        advice=advice,
    )


CAUSE = base.Cause(
    name="motion",
    label="things that moved",
    unit="%",
    find=find,
    called="things {probably}moved",
    sentence="Things {probably}moved between photos: {said}{photos}.",
    advice="train longer, then warp the photos once (rounds: 1). Where only objects "
    f"move in the demo's scene, warping brought {WARPED_MOTION_DB} dB at as many "
    f"steps, and lost {-WARPED_MOTION_TWICE_DB} dB to a training as long as both.",
    advice_external="leave out the photos in which things moved, or train on warped "
    "ones, which `{export}` writes.",
    page="howto/fix.md#something-moved",
)
