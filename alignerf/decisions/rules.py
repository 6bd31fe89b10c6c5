"""Which settings a scene's facts call for: pure, every constant named and measured.

Notation: lengths are in units of the largest camera coordinate, as `near` is. The
constants were chosen on courtyard, seed 1, and fox; docs/evidence/decided.md shows what
they bring on other scenes.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from alignerf.experiment.keys import model as model_keys
from alignerf.experiment.keys import scene as scene_keys
from alignerf.experiment.keys import training as training_keys
from alignerf.files import json_files

# Of the nearest point's distance: COLMAP's points are corners, smooth surfaces may be
# nearer.
NEAR_SHARE = 0.6
# What a model takes, and float32 can tell apart.
LENGTHS = (1e-6, 1e6)
# Side of contracted space.
CONTRACTED_SIDE = 4.0
# Cells of the finest level across what a pixel covers at the median depth.
CELLS_A_PIXEL = 1.0
FINEST = (256, 8192)
# How often each pixel is seen, and between how many steps: 2000 were 0.7 dB below 4000
# on courtyard's 1.26 million pixels.
PASSES = 0.5
STEPS = (4000, 20000)
# Facts that decide something.
FACTS = dict.fromkeys(("nearest", "median_depth"), json_files.NUMBER_OR_NONE)
FACTS["pixel_angle_mrad"] = json_files.NUMBER
COUNTS = ("train_views", "width_px", "height_px")
FACTS |= dict.fromkeys(COUNTS, int)
OF_DOWNSCALE = ("photo_width_px", "photo_height_px", "views")


class Decision(NamedTuple):
    """A key of a job, its value without facts, its value with them, and why."""

    key: str
    default: Any
    value: Any
    reason: str
    # {name: value} of the facts behind it.
    facts: dict


def decide(facts) -> list[Decision]:
    """The decisions on the content of a facts.json.

    A key whose facts are unknown keeps its default, and the reason says so.
    """
    first = [downscale(facts)] if facts.get("downscale_decided") else []
    return [*first, *(rule(facts) for rule in (near, radius, finest, steps))]


def downscale(facts):
    """The decision of stage `poses` on the factor by which photos are made smaller."""
    width, height, views = (facts[name] for name in OF_DOWNSCALE)
    return Decision(
        "scenes.downscale",
        scene_keys.Scene.default("downscale"),
        facts["downscale"],
        f"{views} photos of {width}x{height} have {views * width * height / 1e6:.3g} "
        "million pixels",
        {name: facts[name] for name in OF_DOWNSCALE},
    )


def near(facts):
    """The first sample lies a little before the nearest point."""
    default = model_keys.Model().near
    nearest = facts["nearest"]
    if not known(nearest):
        return unknown("model.near", default, facts, ["nearest"])
    return Decision(
        "model.near",
        default,
        digits(np.clip(NEAR_SHARE * nearest, *LENGTHS)),
        f"the nearest points are {nearest:g} away",
        {"nearest": nearest},
    )


def radius(facts):
    """Contraction begins where the scene does, if that is beyond the cameras.

    Of a forward-facing capture, all of it would be contracted.
    """
    default = model_keys.Model().radius
    nearest = facts["nearest"]
    if not known(nearest):
        return unknown("model.radius", default, facts, ["nearest"])
    value = max(default, digits(np.clip(nearest, *LENGTHS)))
    where = "beyond" if value > default else "among"
    reason = f"the nearest points are {where} the cameras"
    return Decision("model.radius", default, value, reason, {"nearest": nearest})


def finest(facts):
    """The finest cells are what a pixel covers at the median depth."""
    default = model_keys.Model().field.finest
    names = ("pixel_angle_mrad", "median_depth")
    used = {name: facts[name] for name in names}
    if not all(map(known, used.values())):
        return unknown("model.field.finest", default, facts, names)
    angle_mrad, depth = used.values()
    footprint = angle_mrad / 1e3 * depth
    begins = radius(facts).value
    contracted = footprint / begins * contraction_across(depth / begins)
    cells = np.exp2(np.round(np.log2(CELLS_A_PIXEL * CONTRACTED_SIDE / contracted)))
    reason = f"a pixel covers {footprint:.2g} at the median depth"
    return Decision(
        "model.field.finest", default, int(np.clip(cells, *FINEST)), reason, used
    )


def contraction_across(distance):
    """Stretch of the contraction across the radius, at a distance from the middle."""
    return 1.0 if distance <= 1 else (2 - 1 / distance) / distance


def steps(facts):
    """Pixels are seen as often in a large scene as in a small one."""
    usual = training_keys.Training()
    default, batch = usual.steps, usual.batch_rays
    pixels = math.prod(facts[name] for name in COUNTS)
    count = int(np.clip(100 * math.ceil(PASSES * pixels / batch / 100), *STEPS))
    seen = count * batch / pixels
    return Decision(
        "training.steps",
        default,
        count,
        f"each of {pixels / 1e6:.3g} million pixels is seen {seen:.2g} times, with "
        f"{batch} rays a step",
        {name: facts[name] for name in COUNTS},
    )


def known(fact):
    """Whether a fact is a length or an angle: a finite number above 0."""
    return isinstance(fact, int | float) and 0 < fact < math.inf


def digits(value, count=3):
    """A number of so many significant digits: facts are no more exact."""
    return float(f"{value:.{count}g}")


def unknown(key, default, facts, names):
    """The decision to keep the default: one of these facts is unknown."""
    return Decision(
        *(key, default, default, f"not known: {', '.join(names)}"),
        {name: facts.get(name) for name in names},
    )


def line(decision):
    """A decision as users read it."""
    name, value = decision.key, f"{decision.value:g}"
    changed = decision.value != decision.default
    usual = f"default {decision.default:g}" if changed else "the default"
    return f"suggested: {name} {value} ({usual}): {decision.reason}"
