"""The verdict as the page shows it: headline, what to do first, gauges, a summary.

From verdict.json. One that lacks newer keys is shown as far as it goes.
"""

import math

from alignerf.files import json_files

# What it takes from a verdict.json.
VERDICT = {"verdict": list, "state": str, "evidence": dict}
LEVELS = ("sure", "likely", "not seen", "untold")
SEEN = LEVELS[:2]
# A gauge's mark, where the limit is, in shares of its width.
MARK = 0.5


def read(folder):
    """{headline, state, do_first, tried, measured, gauges, evidence} of a scene."""
    path = folder / "verdict.json"
    content = json_files.read(path, VERDICT)
    for line in content["verdict"] or [None]:
        if not isinstance(line, str):
            raise ValueError(f"{path}: verdict is not lines of text")
    head, *lines = content["verdict"]
    todo = [line for line in lines if line.startswith("To do: ")]
    text = todo[0].removeprefix("To do: ") if todo else None
    measured = [line for line in lines if line not in todo]
    return {
        "headline": content.get("headline") or head.removeprefix("Verdict: "),
        "state": content["state"],
        "do_first": content.get("do_first") or {"text": text, "command": None},
        "tried": content.get("tried", []),
        "measured": content.get("measured", measured),
        "gauges": [gauge(cause) for cause in content.get("causes", [])],
        "evidence": content["evidence"],
    }


def gauge(cause):
    """A cause as a gauge: how far it is filled, and what stands beside it.

    filled: in shares of the gauge's width, MARK at the limit; None where it could not
    be told.
    """
    level = cause.get("level")
    if level not in LEVELS:
        raise ValueError(f"verdict.json: level {level!r} of a cause")
    value, limit = cause.get("value"), cause.get("limit")
    known = all(isinstance(one, int | float) for one in (value, limit))
    shown = {"name": cause["name"], "level": level, "text": cause.get("text") or ""}
    if not known or level == "untold":
        return shown | {"filled": None, "numbers": ""}
    # Of a length of training, say, more is better: then it is seen where it is less.
    least = value != limit and (value > limit) != (level in SEEN)
    part, whole = (limit, value) if least else (value, limit)
    times = part / whole if whole > 0 else math.inf if part > 0 else 0.0
    word = "at least" if least else "up to"
    unit = f" {cause['unit']}" if cause.get("unit") else ""
    numbers = f"{value:.3g}{unit} (fine: {word} {limit:.3g})"
    return shown | {"filled": min(max(MARK * times, 0.0), 1.0), "numbers": numbers}


def summary(scene, told, facts, export):
    """A few lines of text to send to somebody."""
    first = told["do_first"]
    lines = [f"{scene}: {told['headline']}"]
    if first["text"]:
        lines.append(f"Do first: {first['text']}")
    if first["command"]:
        lines.append(f"    {first['command']}")
    lines += [f"Tried: {one['text']}" for one in told["tried"]]
    lines += told["measured"]
    for level in LEVELS:
        named = [one for one in told["gauges"] if one["level"] == level]
        if named:
            each = ", ".join(f"{g['name']} {g['numbers']}".strip() for g in named)
            lines.append(f"{level.capitalize()}: {each}")
    lines.append("; ".join(f"{name}: {text}" for name, text in facts))
    return "\n".join([*lines, f"For other programs: {export}"])
