"""The verdict as the page shows it: headline, what to do first, gauges, a summary.

From verdict.json, which holds what `alignerf.verdict.report` tells.
"""

from alignerf import causes
from alignerf.io import json_files
from alignerf.verdict import report

LEVELS = ("sure", "likely", "not seen", "untold")
# How often the cause of a planted fault is named first: {capture: (right, of)}, by
# limits fitted on the others; and false causes a verdict (docs/measured/verdicts.csv).
RIGHT = {
    "castle": (32, 36),
    "courtyard": (36, 37),
    "fox": (37, 40),
    "chair": (38, 40),
    "flower": (35, 37),
    "treehill": (22, 29),
}
FALSE_EACH = 0.08
# A gauge's mark, where the limit is, in shares of its width.
MARK = 0.5


def read(folder):
    """What verdict.json holds, its command apart from its text, and `gauges`."""
    found = json_files.read(folder / "verdict.json", {"causes": list, "do_first": dict})
    first = found["do_first"] | {"text": report.without_command(found["do_first"])}
    gauges = [*map(gauge, found["causes"])]
    return found | {"do_first": first, "gauges": gauges, "right": how_right()}


def how_right():
    """How far the verdict is to be trusted, in two sentences."""
    each = ", ".join(f"{name} {right} of {of}" for name, (right, of) in RIGHT.items())
    return (
        "How often it is right: of faults planted in captures, the cause that was "
        f"named first was the planted one in {each}, by limits that the capture had no "
        f"part in. {FALSE_EACH:.2f} causes a verdict were named and not there."
    )


def gauge(one):
    """A cause as a gauge: how far it is filled, and what stands beside it.

    filled: in shares of the gauge's width, MARK at the limit; None where it could not
    be told.
    """
    level, value, limit = one["level"], one["value"], one["limit"]
    shown = {key: one[key] for key in ("name", "level", "text")}
    said = one["text"].removeprefix(f"{one['name']} (").removesuffix(")")
    if value is None or limit is None or level == "untold":
        why = said if said.startswith(report.CANNOT_TELL) else ""
        return shown | {"filled": None, "numbers": why}
    inverse = {cause.name for cause in causes.every() if cause.more_is_better}
    part, whole = (limit, value) if one["cause"] in inverse else (value, limit)
    # Where none is right, one is as far as it goes.
    share = MARK * (part / whole) if whole > 0 else float(part > 0)
    # What lies beyond its limit, and within its error, is not shown as beyond.
    most = MARK if level == "not seen" else 1.0
    numbers = said
    if said.endswith(one["unit"]):
        numbers = f"{value:.3g} {one['unit']}"
        numbers += f" (fine: up to {limit:.3g})" * bool(limit)
    return shown | {"filled": min(max(share, 0.0), most), "numbers": numbers}


def summary(scene, told, facts, export):
    """A few lines of text to send to somebody."""
    first, command = told["do_first"]["text"], told["do_first"]["command"]
    lines = [f"{scene}: {told['headline']}", *told["because"], f"Do first: {first}"]
    lines += [f"    {command}"] * bool(command)
    lines += [f"Tried: {one['text']}" for one in told["tried"]]
    lines += told["measured"]
    for level in LEVELS:
        named = [
            f"{one['name']} {one['numbers']}".strip()
            for one in told["gauges"]
            if one["level"] == level
        ]
        lines += [f"{level.capitalize()}: {', '.join(named)}"] * bool(named)
    lines.append("; ".join(f"{name}: {text}" for name, text in facts))
    return "\n".join(lines + [f"For other programs: {export}"] * (export is not None))
