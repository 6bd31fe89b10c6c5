"""The verdict as the page shows it: headline, what to do first, gauges, a summary.

From verdict.json, which holds what `alignerf.verdict.report` tells.
"""

from alignerf.experiment.checks import verdict as of_verdict
from alignerf.files import json_files
from alignerf.verdict import report

# What it takes from a verdict.json, and of the parts of it.
VERDICT = {"headline": str, "because": list, "measured": list, "tried": list}
VERDICT |= {"do_first": dict, "causes": list, "state": str, "evidence": dict}
NUMBER, TEXT = json_files.NUMBER_OR_NONE, (str, type(None))
FIRST = {"text": str, "command": TEXT}
TRIED = {"text": str, "pays": bool, "db": NUMBER, "method": str}
CAUSE = {"cause": str, "name": str, "level": str, "unit": str, "text": str}
CAUSE |= {"value": NUMBER, "limit": NUMBER}
LEVELS = ("sure", "likely", "not seen", "untold")
# Of these causes more is better.
LEAST = ("undertrained",)
# A gauge's mark, where the limit is, in shares of its width.
MARK = 0.5


def read(folder):
    """{headline, state, because, do_first, tried, measured, gauges, evidence}."""
    path = folder / "verdict.json"
    content = of_verdict.read(path, VERDICT, do_first=FIRST, tried=TRIED, causes=CAUSE)
    try:
        check(content)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    first, gauges = content["do_first"], [gauge(one) for one in content["causes"]]
    first = first | {"text": report.without_command(first)}
    kept = ("headline", "state", "because", "tried", "measured", "evidence")
    found = {key: content[key] for key in kept}
    return found | {"do_first": first, "gauges": gauges}


def check(content):
    """ValueError where a part of a verdict is not what is told."""
    for one in content["causes"]:
        if one["level"] not in LEVELS:
            raise ValueError(f"causes: level is {one['level']!r:.60}")
    known = content["evidence"].get("overfit_px")
    json_files.check({"evidence.overfit_px": known}, {"evidence.overfit_px": NUMBER})
    if known is not None and known < 0:
        raise ValueError(f"evidence.overfit_px is {known!r:.60}")


def gauge(cause):
    """A cause as a gauge: how far it is filled, and what stands beside it.

    filled: in shares of the gauge's width, MARK at the limit; None where it could not
    be told.
    """
    level, value, limit = cause["level"], cause["value"], cause["limit"]
    shown = {"name": cause["name"], "level": level, "text": cause["text"]}
    if value is None or limit is None or level == "untold":
        return shown | {"filled": None, "numbers": ""}
    least = cause["cause"] in LEAST
    part, whole = (limit, value) if least else (value, limit)
    # Where none is right, one is as far as it goes.
    share = MARK * (part / whole) if whole > 0 else float(part > 0)
    if level == "not seen":
        # What lies beyond its limit, and within its error, is not shown as beyond.
        share = min(share, MARK)
    return shown | {"filled": min(max(share, 0.0), 1.0), "numbers": numbers(cause)}


def numbers(cause):
    """A gauge's number and limit in words; a cause's own where it has some."""
    own = cause["text"].removeprefix(f"{cause['name']} (").removesuffix(")")
    if not own.endswith(cause["unit"]):
        return own
    value = f"{cause['value']:.3g} {cause['unit']}"
    return f"{value} (fine: up to {cause['limit']:.3g})" if cause["limit"] else value


def summary(scene, told, facts, export):
    """A few lines of text to send to somebody."""
    first = told["do_first"]
    lines = [f"{scene}: {told['headline']}", *told["because"]]
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
    return "\n".join(lines + [f"For other programs: {export}"] * (export is not None))
