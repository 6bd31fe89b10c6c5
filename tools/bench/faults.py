"""Faults that are planted into captures: in photos, cameras, trainings and renders.

Each has three strengths, from one that hardly matters to one that nobody overlooks.
Lengths are px of the photo. `PLANTS` is the registry, `PAIRS` what is planted at once.
"""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

from alignerf.scenes import cameras
from flow.camera import motion

# Of the photos, those that a fault of some photos is put into.
FRACTION = 0.15
# Of moving patches: how many, and their radius as a fraction of the shorter side.
PATCHES, PATCH_RADIUS = 3, 0.2
CAMERAS = ("pixtocams", "camtoworlds")
BORDER = cv2.BORDER_REFLECT_101


class Capture(NamedTuple):
    """Photos [n, h, w, 3] uint8 and cameras of a capture, and how long it is trained.

    points [m, 3]: of its surface. names, split: of each view. fraction: of the steps.
    """

    names: list
    split: np.ndarray
    photos: np.ndarray
    pixtocams: np.ndarray
    camtoworlds: np.ndarray
    points: np.ndarray
    fraction: float = 1.0

    @property
    def size(self):
        """(width, height) of the photos."""
        return self.photos.shape[2], self.photos.shape[1]

    @property
    def some(self):
        """How many views a fault of some views is put into."""
        return max(2, round(FRACTION * len(self.names)))


class Plant(NamedTuple):
    """A fault: the cause that is to be named, and how it is put in.

    causes: the first is the fault's own; the others say the same of it. strengths: in
    the fault's unit. before: (Capture, strength, rng) -> Capture, put in before a
    training; after: (renders [n, h, w, 3], depth [n, h, w], strength, rng) -> both, put
    into renders.
    """

    causes: tuple
    strengths: tuple
    unit: str
    before: Callable | None = None
    after: Callable | None = None


def moved(image, flow_px):
    """An image [h, w, 3] whose pixel x shows what was at x + flow."""
    height, width = image.shape[:2]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    at = x + flow_px[..., 0].astype(np.float32), y + flow_px[..., 1].astype(np.float32)
    return cv2.remap(image, *at, cv2.INTER_LANCZOS4, borderMode=BORDER)


def brighter(image, stops):
    """The image, as many stops of 8-bit values brighter."""
    return np.clip(np.round(image * 2.0**stops), 0, 255).astype(np.uint8)


def blurred(capture, sigma_px, rng):
    photos = capture.photos.copy()
    for view in rng.permutation(len(photos))[: capture.some]:
        photos[view] = cv2.GaussianBlur(photos[view], (0, 0), sigma_px)
    return capture._replace(photos=photos)


def exposed(capture, stops_ev, rng):
    stops = rng.normal(scale=stops_ev, size=len(capture.photos))
    photos = [brighter(*one) for one in zip(capture.photos, stops, strict=True)]
    return capture._replace(photos=np.array(photos))


def moving(capture, length_px, rng):
    """Patches around points of the scene move in each photo by another vector."""
    middle = np.median(capture.points, axis=0)
    near = np.argsort(np.linalg.norm(capture.points - middle, axis=-1))
    anchors = capture.points[near[: max(len(near) // 2, PATCHES)]]
    anchors = anchors[rng.choice(len(anchors), PATCHES, replace=False)]
    width, height = capture.size
    radius = PATCH_RADIUS * min(width, height)
    y, x = np.mgrid[:height, :width] + 0.5
    photos = []
    for view, photo in enumerate(capture.photos):
        at, depth = cameras.project(
            anchors, capture.pixtocams[view], capture.camtoworlds[view]
        )
        flow_px = np.zeros((height, width, 2))
        for (u, v), far in zip(at, depth, strict=True):
            angle = rng.uniform(0, 2 * np.pi)
            if far > 0:
                share = np.exp(-((np.hypot(x - u, y - v) / radius) ** 4))
                flow_px += (
                    share[..., None]
                    * length_px
                    * np.array([np.cos(angle), np.sin(angle)])
                )
        photos.append(moved(photo, flow_px))
    return capture._replace(photos=np.array(photos))


def pasted(every):
    """Puts an object into every n-th photo, each time at another place.

    It covers a fraction of the photo, and has the texture of another part of the
    capture in another colour.
    """

    def change(capture, fraction, rng):
        photos = capture.photos.copy()
        texture = texture_of(capture, rng)
        for view in range(0, len(photos), every):
            middle = rng.uniform(0.15, 0.85, 2) * capture.size
            photos[view] = covered(photos[view], middle, fraction, texture, rng)
        return capture._replace(photos=photos)

    return change


def walking(capture, fraction, rng):
    """Somebody walks through the scene while photos are taken one after the other.

    fraction: of the median photo, where they are seen.
    """
    photos = capture.photos.copy()
    texture = texture_of(capture, rng)
    middle, spread = np.median(capture.points, axis=0), np.std(capture.points, axis=0)
    ends = middle + np.array([[-1.0], [1.0]]) * rng.normal(size=3) * spread
    shown = [
        cameras.project(middle, *camera)[1]
        for camera in zip(capture.pixtocams, capture.camtoworlds, strict=True)
    ]
    usual = np.median(np.abs(shown))
    for view, at in enumerate(np.linspace(0, 1, len(photos))):
        camera = capture.pixtocams[view], capture.camtoworlds[view]
        place = ends[0] + at * (ends[1] - ends[0])
        pixel, depth = cameras.project(place, *camera)
        if depth > 0.2 * usual:
            size = min(fraction * (usual / depth) ** 2, 2 * fraction)
            photos[view] = covered(photos[view], pixel, size, texture, rng)
    return capture._replace(photos=photos)


def texture_of(capture, rng):
    """[h, w, 3] uint8 of an object: a photo, magnified, in another colour."""
    photo = capture.photos[rng.integers(len(capture.photos))]
    height, width = photo.shape[:2]
    part = photo[height // 4 : 3 * height // 4, width // 4 : 3 * width // 4]
    part = cv2.resize(part, (width, height), interpolation=cv2.INTER_CUBIC)
    dyed = part.astype(float) * rng.uniform(0.3, 0.7) + rng.uniform(0, 90, 3)
    return np.clip(dyed, 0, 255).astype(np.uint8)


def covered(photo, middle, fraction, texture, rng):
    """A photo with an upright ellipse of so much of its area around a pixel (x, y)."""
    height, width = photo.shape[:2]
    tall = rng.uniform(1.2, 2.2)
    across = np.sqrt(fraction * width * height / (np.pi * tall))
    y, x = np.mgrid[:height, :width]
    far = np.hypot((x - middle[0]) / across, (y - middle[1]) / (tall * across))
    alpha = np.clip((1 - far) * across, 0, 1)[..., None]
    return np.round(photo * (1 - alpha) + texture * alpha).astype(np.uint8)


def smeared(capture, length_px, rng):
    """The camera moves while some photos are taken: along a line, in any direction."""
    photos = capture.photos.copy()
    for view in rng.permutation(len(photos))[: capture.some]:
        angle, radius = rng.uniform(0, np.pi), int(np.ceil(length_px))
        along = np.linspace(-0.5, 0.5, 16 * radius) * length_px
        x, y = (np.rint(along * part) for part in (np.cos(angle), np.sin(angle)))
        kernel = np.zeros((2 * radius + 1,) * 2)
        np.add.at(kernel, (radius + y.astype(int), radius + x.astype(int)), 1)
        photos[view] = cv2.filter2D(photos[view], -1, kernel / kernel.sum())
    return capture._replace(photos=photos)


def sheared(capture, skew_px, rng):
    """Rows are read one after the other while the camera moves on to the next photo.

    skew_px: from the first row to the last, in the median photo.
    """
    flows = velocities(capture)
    skews = [np.linalg.norm(np.median(flow, axis=(0, 1))) for flow in flows]
    rows = (np.arange(capture.size[1]) + 0.5) / capture.size[1] - 0.5
    fraction = skew_px / max(np.median(skews), 1e-9)
    photos = [
        moved(photo, fraction * rows[:, None, None] * flow)
        for photo, flow in zip(capture.photos, flows, strict=True)
    ]
    return capture._replace(photos=np.array(photos))


def velocities(capture):
    """[n, h, w, 2]: px that the scene moves by from each photo to the next by name."""
    width, height = capture.size
    found = []
    for view in range(len(capture.names)):
        first = min(view, len(capture.names) - 2)
        one, other = (
            (capture.pixtocams[v], capture.camtoworlds[v]) for v in (first, first + 1)
        )
        _, depth = cameras.project(capture.points, *one)
        far = np.median(depth[depth > 0]) if (depth > 0).any() else np.inf
        points = motion.points_of(one[0], np.full((height, width), far))
        found.append(motion.flow(motion.between(one, other), points))
    return np.array(found)


def mirrored(capture, share, rng):
    photos = capture.photos.copy()
    chosen = rng.permutation(len(photos))[: max(1, round(share * len(photos)))]
    photos[chosen] = photos[chosen, :, ::-1]
    return capture._replace(photos=photos)


def copied(capture, share, rng):
    """Some photos lie there twice, by another name."""
    count = len(capture.names)
    chosen = rng.permutation(count)[: max(1, round(share * count))]
    order = np.sort(np.concatenate([np.arange(count), chosen]), kind="stable")
    again = np.diff(order, prepend=-1) == 0
    names = [
        f"{capture.names[view]}_copy" if twice else capture.names[view]
        for view, twice in zip(order, again, strict=True)
    ]
    taken = {key: getattr(capture, key)[order] for key in ("photos", *CAMERAS)}
    split = np.where(np.arange(len(order)) % 8 == 0, "test", "train")
    return capture._replace(names=names, split=split, **taken)


def thinned(capture, share, rng):
    """A share of the photos to learn from was never taken; those held out stay."""
    learnt = np.flatnonzero(capture.split == "train")
    gone = rng.permutation(learnt)[: round(share * len(learnt))]
    kept = np.delete(np.arange(len(capture.names)), gone)
    taken = {key: getattr(capture, key)[kept] for key in ("photos", *CAMERAS)}
    return capture._replace(
        names=[capture.names[view] for view in kept], split=capture.split[kept], **taken
    )


def turned(capture, error_px, rng):
    poses = cameras.perturb_poses(capture.camtoworlds, capture.pixtocams, error_px, rng)
    return capture._replace(camtoworlds=poses)


def lens_changed(capture, focal=1.0, shift_px=0.0):
    camtopix = np.linalg.inv(capture.pixtocams)
    camtopix[:, [0, 1], [0, 1]] *= focal
    camtopix[:, :2, 2] += shift_px
    return capture._replace(pixtocams=np.linalg.inv(camtopix))


def bent(capture, corner_px, rng):
    """Photos of a lens that moves their corners outwards, which was left out."""
    width, height = capture.size
    y, x = np.mgrid[:height, :width].astype(np.float64)
    at = np.stack([x - (width - 1) / 2, y - (height - 1) / 2], axis=-1)
    half = np.hypot(width, height) / 2
    square = (at**2).sum(axis=-1, keepdims=True) / half**2
    flow_px = -at * corner_px / half * square
    return capture._replace(
        photos=np.array([moved(photo, flow_px) for photo in capture.photos])
    )


def shuffled(capture, share, rng):
    """Some cameras change places in a ring; with a share of 1 each takes the next's."""
    count = len(capture.names)
    chosen = np.sort(rng.permutation(count)[: max(2, round(share * count))])
    poses = capture.camtoworlds.copy()
    poses[chosen] = poses[np.roll(chosen, -1)]
    return capture._replace(camtoworlds=poses)


def toned(renders, *, stops=(0, 0, 0), gamma=1.0):
    values = 255 * (renders / 255.0) ** gamma * 2.0 ** np.array(stops, float)
    return np.clip(np.round(values), 0, 255).astype(np.uint8)


def halved(renders, factor):
    height, width = renders.shape[1:3]
    small = round(width / factor), round(height / factor)
    return np.array(
        [
            cv2.resize(
                cv2.resize(one, small, interpolation=cv2.INTER_AREA),
                (width, height),
                interpolation=cv2.INTER_CUBIC,
            )
            for one in renders
        ]
    )


def floating(renders, depth, share, rng):
    """A blob close to the camera covers a part of some renders."""
    renders, depth = renders.copy(), depth.copy()
    count, height, width = depth.shape
    y, x = np.mgrid[:height, :width]
    for view in rng.permutation(count)[: max(1, round(share * count))]:
        u, v = rng.uniform(0.2, 0.8, 2) * (width, height)
        radii = rng.uniform(0.12, 0.3, 2) * min(width, height)
        alpha = np.exp(-((((x - u) / radii[0]) ** 2 + ((y - v) / radii[1]) ** 2) ** 2))
        colour = rng.uniform(20, 200, 3)
        mixed = renders[view] * (1 - alpha[..., None]) + colour * alpha[..., None]
        renders[view] = np.round(mixed)
        depth[view] = np.where(alpha > 0.5, 0.05 * np.median(depth[view]), depth[view])
    return renders, depth


def of_images(change):
    """A fault of renders alone, as `Plant.after` takes it."""
    return lambda renders, depth, strength, rng: (change(renders, strength), depth)


def shifted(renders, px):
    flow_px = np.full((*renders.shape[1:3], 2), px)
    return np.array([moved(one, flow_px) for one in renders])


def next_ones(renders, share):
    chosen = np.arange(max(2, round(share * len(renders))))
    found = renders.copy()
    found[chosen] = renders[np.roll(chosen, -1)]
    return found


# Over two stops of light no pair is told: the line says to write renders in sRGB.
TONE = ("tone", "pairs")
PLANTS = {
    "nothing": Plant((), (0.0,), ""),
    "poses": Plant(("camera",), (1.0, 2.5, 6.0), "px", before=turned),
    "focal": Plant(
        ("focal",),
        (1.01, 1.03, 1.08),
        "times",
        before=lambda capture, times, rng: lens_changed(capture, focal=times),
    ),
    "principal point": Plant(
        ("lens_shift",),
        (1.5, 4.0, 10.0),
        "px",
        before=lambda capture, px, rng: lens_changed(capture, shift_px=px),
    ),
    "distortion": Plant(("lens_distortion",), (2.0, 5.0, 12.0), "px", before=bent),
    "order": Plant(("camera", "pairs"), (0.1, 0.3, 1.0), "of the cameras", shuffled),
    "blur": Plant(("blurred",), (1.5, 3.0, 6.0), "px", before=blurred),
    "exposure": Plant(("exposure",), (0.1, 0.2, 0.4), "stops", before=exposed),
    "motion": Plant(("motion",), (2.0, 5.0, 10.0), "px", before=moving),
    "every second": Plant(
        ("transients",), (0.02, 0.05, 0.15), "of a photo", before=pasted(2)
    ),
    "every fifth": Plant(
        ("transients",), (0.02, 0.05, 0.15), "of a photo", before=pasted(5)
    ),
    "walker": Plant(("transients",), (0.02, 0.05, 0.1), "of a photo", before=walking),
    "motion blur": Plant(("blurred",), (2.5, 5.0, 10.0), "px", before=smeared),
    "fewer photos": Plant(
        ("sparse", "few_views"),
        (0.25, 0.5, 0.75),
        "of the photos to learn from",
        before=thinned,
    ),
    "rolling shutter": Plant(
        ("rolling_shutter",), (2.0, 5.0, 12.0), "px", before=sheared
    ),
    "mirrored photos": Plant(("pairs",), (0.05, 0.1, 0.2), "of them", before=mirrored),
    "copies": Plant(("copies",), (0.05, 0.1, 0.2), "of them", before=copied),
    "short": Plant(
        ("undertrained", "undertrained_renders"),
        (0.3, 0.1, 0.03),
        "of the steps",
        before=lambda capture, share, rng: capture._replace(fraction=share),
    ),
    "gain": Plant(
        TONE,
        (-0.15, -0.33, -0.7),
        "stops",
        after=of_images(lambda renders, ev: toned(renders, stops=(ev,) * 3)),
    ),
    "gamma": Plant(
        TONE,
        (1.1, 1.3, 2.2),
        "power",
        after=of_images(lambda renders, power: toned(renders, gamma=power)),
    ),
    "white balance": Plant(
        TONE,
        (0.08, 0.2, 0.4),
        "stops",
        after=of_images(lambda renders, ev: toned(renders, stops=(ev, 0, -ev))),
    ),
    "channels": Plant(
        ("channels", "pairs"),
        (1.0,),
        "of the renders in BGR",
        after=of_images(lambda renders, share: renders[..., ::-1]),
    ),
    "shift": Plant(
        ("lens_shift",), (0.25, 0.5, 1.5), "px of the render", after=of_images(shifted)
    ),
    "size": Plant(
        ("half_size",), (1.4, 2.0, 4.0), "times smaller", after=of_images(halved)
    ),
    "next render": Plant(
        ("pairs",), (0.06, 0.3, 1.0), "of the renders", after=of_images(next_ones)
    ),
    "floaters": Plant(("floaters",), (0.06, 0.15, 0.3), "of the views", after=floating),
}
# Two at once, each of the middle strength.
PAIRS = (
    ("poses", "exposure"),
    ("motion", "blur"),
    ("poses", "short"),
    ("exposure", "distortion"),
    ("gain", "motion"),
    ("size", "poses"),
    ("poses", "motion"),
    ("gain", "poses"),
)
