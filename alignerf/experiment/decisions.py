"""Which settings a scene's facts call for: pure, every constant named and measured.

`alignerf.facts` writes decisions.json: each key with its default, its value, the reason
and the facts behind it. A config with `decide: true` takes the decisions for all keys
that it leaves out (`jobs.fill`).

Notation: lengths are in units of the largest camera coordinate, as `near` is. The
constants were chosen on courtyard, seed 1, and fox; docs/evidence/fixes.md shows what
they bring on other scenes.
"""

import math
from typing import Any, NamedTuple

from alignerf.experiment.keys import scene as scene_keys
from alignerf.experiment.keys import training as training_keys
from alignerf.io import json_files
from alignerf.systems import base

# Of the nearest point's distance: COLMAP's points are corners, smooth surfaces may be
# nearer.
NEAR_FRACTION = 0.6
# What a model takes, and float32 can tell apart.
LENGTHS = (1e-6, 1e6)
# Side of contracted space.
CONTRACTED_SIDE = 4.0
# Cells of the finest level across what a pixel covers at the median depth.
CELLS_A_PIXEL = 1.0
FINEST = (256, 8192)
# How often each pixel is seen, and between how many steps: 2000 were 0.7 dB below 4000
# on courtyard's 1.26 million pixels.
EPOCHS = 0.5
STEPS = (4000, 20000)
# Facts that decide the number of steps, and the factor by which photos are smaller.
COUNTS = ("train_views", "width_px", "height_px")
OF_DOWNSCALE = ("photo_width_px", "photo_height_px", "views")


# Keys that may be null in a complete config, besides `downscale`.
OPEN = (*base.USUAL, "steps")


class Decision(NamedTuple):
    """A key of a job, its value without facts, its value with them, and why."""

    key: str
    default: Any
    value: Any
    reason: str
    # {name: value} of the facts behind it.
    facts: dict


# As a decisions.json has it.
DECISION = {"key": str, "reason": str, "facts": dict}
DECISION |= dict.fromkeys(("default", "value"), json_files.positive)


def decide(facts) -> list[Decision]:
    """The decisions on the content of a facts.json.

    A key whose facts are unknown keeps its default, and the reason says so.
    """
    first = [downscale(facts)] if facts.get("downscale_decided") else []
    return [*first, *(rule(facts) for rule in (near, radius, max_resolution, steps))]


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
    default = base.USUAL["near"]
    nearest = facts["nearest"]
    if not known(nearest):
        return unknown("model.near", default, facts, ["nearest"])
    return Decision(
        "model.near",
        default,
        digits(clip(NEAR_FRACTION * nearest, *LENGTHS)),
        f"the nearest points are {nearest:g} away",
        {"nearest": nearest},
    )


def radius(facts):
    """Contraction begins where the scene does, if that is beyond the cameras.

    Of a forward-facing capture, all of it would be contracted.
    """
    default = base.USUAL["radius"]
    nearest = facts["nearest"]
    if not known(nearest):
        return unknown("model.radius", default, facts, ["nearest"])
    value = max(default, digits(clip(nearest, *LENGTHS)))
    where = "beyond" if value > default else "among"
    reason = f"the nearest points are {where} the cameras"
    return Decision("model.radius", default, value, reason, {"nearest": nearest})


def max_resolution(facts):
    """The finest cells are what a pixel covers at the median depth."""
    default = base.USUAL["max_resolution"]
    names = ("pixel_angle_mrad", "median_depth")
    used = {name: facts[name] for name in names}
    if not all(map(known, used.values())):
        return unknown("model.field.max_resolution", default, facts, names)
    angle_mrad, depth = used.values()
    footprint = angle_mrad / 1e3 * depth
    begins = radius(facts).value
    contracted = footprint / begins * contraction_across(depth / begins)
    cells = CELLS_A_PIXEL * CONTRACTED_SIDE / contracted
    cells = clip(2 ** round(math.log2(cells)), *FINEST)
    reason = f"a pixel covers {footprint:.2g} at the median depth"
    return Decision("model.field.max_resolution", default, cells, reason, used)


def contraction_across(distance):
    """Stretch of the contraction across the radius, at a distance from the middle."""
    return 1.0 if distance <= 1 else (2 - 1 / distance) / distance


def steps(facts):
    """Pixels are seen as often in a large scene as in a small one."""
    default, batch = training_keys.USUAL_STEPS, training_keys.Training().batch_rays
    pixels = math.prod(facts[name] for name in COUNTS)
    count = clip(100 * math.ceil(EPOCHS * pixels / batch / 100), *STEPS)
    seen = count * batch / pixels
    return Decision(
        "training.steps",
        default,
        count,
        f"each of {pixels / 1e6:.3g} million pixels is seen {seen:.2g} times, with "
        f"{batch} rays a step",
        {name: facts[name] for name in COUNTS},
    )


def clip(value, lowest, highest):
    """The value between two limits."""
    return min(max(value, lowest), highest)


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


def one(decisions, name, path):
    """The decision on a key, given by the last part of its name."""
    for key, decision in decisions.items():
        if key.rpartition(".")[2] == name:
            return decision
    raise ValueError(f"{path}: nothing on {name}")


def read(path):
    """{key: Decision} of a decisions.json; ValueError names a damaged file."""
    entries = json_files.read(path, {"decisions": [DECISION]})["decisions"]
    return {one["key"]: Decision(*map(one.get, Decision._fields)) for one in entries}


def shown(paths, asked):
    """Lines of files that are there already, each below its scene's name.

    asked: whether the config leaves anything to facts.
    """
    lines = []
    for path in paths:
        lines.append(f"{path.parent.name}: by its facts")
        lines += [f"  {line(decision)}" for decision in read(path).values()]
    if not asked:
        lines.append("This run uses none of it: its config does not say decide: true.")
    return lines
