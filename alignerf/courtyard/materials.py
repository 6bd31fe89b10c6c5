"""What the courtyard's surfaces are covered with.

Notation: textures [h, w, 3] uint8, first row uppermost (on the ground: least y);
shape is (h, w) and size (w, h) in texels; lengths `_m` in metres; colours in 0..1.
"""

import cv2
import numpy as np

from alignerf.courtyard import textures

# Squares of ground: half side in metres, texels along a side, texels per photo pixel.
GROUND = ((1.8, 2048, 0.6), (6.5, 1024, 0.35), (26.0, 1024, 0.3))
# Photographs with detail all over.
POSTERS = (
    "astronaut",
    "camera",
    "chelsea",
    "coffee",
    "coins",
    "immunohistochemistry",
    "stereo_motorcycle",
)


def ground_plan(seed):
    """How the ground varies: function of positions x, y [h, w] in metres.

    It returns (distance along y to the edge of the gravel path in metres, negative on
    the path; tone about 0): the same for squares of all sizes, so that they agree
    where they meet.
    """
    rng = np.random.default_rng([seed, 1])
    grids = rng.standard_normal((3, 160, 160)).astype(np.float32)
    phase = rng.uniform(0, 2 * np.pi)

    def at(k, x, y, cell):
        grid_x, grid_y = (np.float32(v / cell + 80) for v in (x, y))
        return cv2.remap(
            grids[k], grid_x, grid_y, cv2.INTER_CUBIC, None, cv2.BORDER_REFLECT_101
        )

    def plan(x, y):
        path = 0.45 * np.sin(1.4 * x + phase) + 0.15 * at(0, x, y, 0.35)
        edge = np.abs(y + 0.1 - path) - 0.55
        return edge.astype(np.float32), 0.6 * at(1, x, y, 0.4) + 0.6 * at(2, x, y, 2.5)

    return plan


def ground(half_m, texels, scale, plan, rng):
    """Texture of the ground's square of half side `half_m`: grass and gravel."""
    shape = (texels, texels)
    axis = (np.arange(256, dtype=np.float32) + 0.5) / 128 - 1
    x, y = np.meshgrid(axis * half_m, axis * half_m)
    edge, tone = (
        cv2.resize(v, shape, interpolation=cv2.INTER_CUBIC) for v in plan(x, y)
    )
    grass = textures.quilt("grass", shape, rng, scale=1.15 * scale)
    gravel = textures.quilt("gravel", shape, rng, scale=scale)
    hue = 0.5 + 0.5 * textures.fractal(shape, 40, rng)
    green = textures.tint(
        0.42 + 0.24 * grass + 0.06 * tone, (0.05, 0.09, 0.03), (0.6, 0.7, 0.3)
    )
    green *= textures.tint(hue + 0.4 * tone, (0.85, 1.0, 0.9), (1.2, 1.0, 0.75))
    stone = textures.tint(
        0.5 + 0.25 * gravel + 0.08 * tone, (0.12, 0.11, 0.1), (0.9, 0.86, 0.8)
    )
    stone *= textures.tint(hue - 0.4 * tone, (0.95, 1.0, 1.05), (1.08, 0.98, 0.88))
    # Blades stand over stones: the edge follows the grass.
    share = np.clip(0.5 + (edge + 0.03 * grass) / 0.05, 0, 1)[..., None]
    texture = textures.to_bytes(stone + share * (green - stone))
    petals = [(0.95, 0.93, 0.85), (0.9, 0.8, 0.3), (0.55, 0.3, 0.15), (0.7, 0.5, 0.7)]
    textures.flecks(texture, texels**2 // 1800, (1.5, 5.0), petals, rng)
    return texture


def brick_wall(height_m, width_m, rng, *, texel_m=0.002):
    """Texture of a wall whose rows and bricks differ in size, colour and wear."""
    shape = (round(height_m / texel_m), round(width_m / texel_m))
    detail = textures.quilt("gravel", shape, rng, scale=0.4)
    wear = textures.fractal(shape, 60, rng)
    mortar = textures.tint(
        0.6 + 0.12 * detail + 0.1 * wear, (0.2, 0.19, 0.17), (0.8, 0.77, 0.7)
    )
    wall = textures.to_bytes(mortar)
    top = 0
    while top < shape[0]:
        bottom = top + round(rng.uniform(0.036, 0.052) / texel_m)
        left = -round(rng.uniform(0, 0.06) / texel_m)
        while left < shape[1]:
            right = left + round(rng.uniform(0.07, 0.13) / texel_m)
            # Slices that end beyond the wall are cut off by it.
            rows, columns = slice(top, bottom), slice(max(left, 0), right)
            value = 0.45 + 0.2 * detail[rows, columns] + 0.15 * wear[rows, columns]
            value = value + 0.2 * rng.standard_normal()
            light = np.array([0.8, 0.52, 0.4]) + 0.04 * rng.standard_normal(3)
            wall[rows, columns] = textures.to_bytes(
                textures.tint(value, (0.2, 0.08, 0.05), light)
            )
            left = right + 4
        top = bottom + 4
    return cv2.GaussianBlur(wall, (0, 0), 0.5)


def poster(name, size, rng):
    """Texture (width, height) = size of a box's face: a photograph on worn board."""
    photo = textures.photograph(name)
    width, height = size
    scale = max(width / photo.shape[1], height / photo.shape[0]) * rng.uniform(1.1, 1.7)
    photo = photo[:, ::-1] if rng.random() < 0.5 else photo
    if scale < 0.8:
        photo = cv2.GaussianBlur(photo, (0, 0), 0.35 / scale)
    face = textures.crop(photo, size=size, scale=scale, rng=rng, turn=0.5, shear=0.15)
    worn = textures.quilt(rng.choice(["gravel", "brick", "grass"]), face.shape[:2], rng)
    face = face * rng.uniform(0.8, 1.15, size=3) + 0.07
    face *= (1 + 0.11 * worn + 0.08 * textures.fractal(face.shape[:2], 40, rng))[
        ..., None
    ]
    texture = textures.to_bytes(face)
    count = width * height // 1200
    textures.flecks(
        texture, count, (1.0, 4.0), [(0.1, 0.1, 0.1), (0.95, 0.9, 0.8)], rng
    )
    frame = (rng.uniform(0.15, 0.9, size=3) * 255).tolist()
    cv2.rectangle(texture, (0, 0), (width - 1, height - 1), frame, 4)
    return texture


def plain(colour, size, rng):
    """Texture (width, height) = size of painted, weathered material."""
    shape = (size[1], size[0])
    value = (
        0.65
        + 0.14 * textures.fractal(shape, 24, rng)
        + 0.14 * textures.noise(shape, 2, rng)
    )
    return textures.to_bytes(textures.tint(value, np.array(colour) * 0.3, colour))


def foliage(shape, dark, light, rng):
    """Texture of a far hedge or wooded hill, darker at the foot."""
    leaves = textures.quilt("grass", shape, rng, scale=0.8)
    clumps = textures.fractal(shape, 40, rng)
    value = 0.45 + 0.2 * leaves + 0.22 * clumps
    value = value - 0.15 * np.linspace(-1, 1, shape[0], dtype=np.float32)[:, None]
    hue = textures.tint(
        0.5 + 0.5 * textures.noise(shape, 70, rng), (0.85, 1, 1), (1.15, 0.97, 0.8)
    )
    return textures.to_bytes(textures.tint(value, dark, light) * hue)


def sky(shape, rng):
    """Texture of the sky from the zenith (first row) to the horizon: clouds."""
    h, w = shape
    height = np.linspace(1, 0, h, dtype=np.float32)[:, None] * np.ones(w, np.float32)
    blue = textures.tint(height, (0.72, 0.82, 0.92), (0.25, 0.45, 0.8))
    # Clouds are flat: wider than tall.
    cover, shade = (
        cv2.resize(textures.fractal((h, w // 4), cell, rng, octaves=6), (w, h))
        for cell in (50, 25)
    )
    share = np.clip(0.25 + 0.6 * cover, 0, 1)[..., None]
    white = textures.tint(0.7 + 0.25 * shade, (0.55, 0.57, 0.62), (1, 1, 1))
    return textures.to_bytes(blue + share * (white - blue))
