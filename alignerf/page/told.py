"""The verdict as the page shows it: what to do first, fixes, checks, a summary.

From verdict.json, which holds what `alignerf.verdict.report` tells.
"""

import shlex
from pathlib import Path

from alignerf import testsets
from alignerf.io import json_files, yaml_files
from alignerf.verdict import kinds, report

# A level's sign, which tells it without colours.
SIGNS = dict(zip(report.LEVELS, ("\u2715", "!", "\u2713", "?"), strict=True))
# Of fixes: those that pay, those that harm, others.
KINDS = {"ok": "\u2713", "faulty": "\u2715", "unclear": "\u2013"}
# Of verdicts on planted faults, each by limits that were fitted on other captures: made
# by `make docs` of docs/measured/verdicts.csv.
ACCURACY = Path(__file__).with_name("accuracy.yaml")
# A bar that is longer than the page is none the longer.
LARGEST = 10.0
# What trains on an export, below the folder of its photos and cameras.
TRAINERS = {
    "nerfstudio": "ns-train splatfacto --data {}",
    "gsplat": "python examples/simple_trainer.py default --data_dir {} --data_factor 1 "
    "--save_ply --disable_viewer",
    "Gaussian splatting": "python train.py -s {} --eval -r 1",
    "OpenSplat": "opensplat {} -n 30000 -o splat.ply",
    "Brush": "brush {}",
}


def read(folder):
    """What verdict.json holds, its command apart from its text, `gauges`, `fixes`."""
    found = json_files.read(folder / "verdict.json", kinds.VERDICT)
    first = found["do_first"] | {"text": report.without_command(found["do_first"])}
    return found | {
        "do_first": first,
        "gauges": [*map(gauge, found["causes"])],
        "fixes": fixes(found["tried"]),
        "about": about(found),
        "right": how_right(),
    }


def about(found):
    """[{name, photos}] of what is named of some photos; earlier verdicts have none."""
    labels = {one["cause"]: one["name"] for one in found["causes"]}
    return [
        {"name": labels.get(one["cause"], one["cause"]), "photos": one["photos"]}
        for one in found.get("findings") or ()
        if one.get("photos")
    ]


def how_right():
    """How far the verdict is to be trusted, in two sentences."""
    table = yaml_files.read(ACCURACY)
    right, cases = map(sum, zip(*table["first"].values(), strict=True))
    return (
        "How often it is right: of faults planted in captures that its rules were not "
        f"made with, the planted cause was named first in {right} of {cases}. "
        f"Beside it, {table['false_each']:.2f} causes a verdict were not planted."
    )


def gauge(one):
    """A cause with its sign, and its `share` of the limit: above 1 is worse.

    None where nothing was measured or it is not significant, and where none is allowed
    or found.
    """
    value, limit, share = one["value"], one["limit"], None
    told = not one["note"] and one["level"] != report.UNKNOWN
    if told and None not in (value, limit):
        part, whole = (limit, value) if one["more_is_better"] else (value, limit)
        share = part / whole if whole > 0 else (LARGEST if part > 0 else None)
    return one | {"sign": SIGNS[one["level"]], "share": share and min(share, LARGEST)}


def fixes(tried):
    """{rows, low, high, against} of the fixes of a run; None where nothing was tried.

    Rows have `kind`, `sign`, and `text_of` gain and interval; a fix without an interval
    has its gain for both ends. low, high: dB that all bars lie between. against: the
    test set in words; where they differ, each row's notes have its own.
    """
    if not tried:
        return None
    against = dict.fromkeys(testsets.against(one["test_set"]) for one in tried)
    rows = []
    for one in (one | ends_of(one) for one in tried):
        kind = "ok" if one["pays"] else "faulty" if one["high"] < 0 else "unclear"
        apart = [testsets.against(one["test_set"])] * (len(against) > 1)
        gain, *interval = report.spoken(one["db"], one["low"], one["high"])
        known = " to ".join(interval) if one["low"] < one["high"] else "unknown"
        more = {"notes": [*apart, *one["notes"]], "text_of": (gain, known)}
        rows.append(one | {"kind": kind, "sign": KINDS[kind]} | more)
    ends = [0.0, *(row[end] for row in rows for end in ("db", "low", "high"))]
    low, high = min(ends), max(*ends, min(ends) + 1e-9)
    said = next(iter(against)) if len(against) == 1 else ""
    return {"rows": rows, "low": low, "high": high, "against": said}


def ends_of(one):
    """The ends of a gain's interval; without one, the gain itself."""
    known = {end: one[end] for end in ("low", "high") if one[end] is not None}
    return {"low": one["db"], "high": one["db"]} | known


def names(tried):
    """{method: its name in words}; of several fixes what their names begin with."""
    found = {}
    for one in tried:
        before = found.get(one["method"])
        found[one["method"]] = before.partition(", ")[0] if before else one["name"]
    return found


def trainers(place):
    """{trainer: the command that trains on what an export wrote to a place}."""
    return {name: text.format(shlex.quote(place)) for name, text in TRAINERS.items()}


def summary(scene, told, facts, export):
    """A few lines of text to send to somebody."""
    first, command = told["do_first"]["text"], told["do_first"]["command"]
    lines = [f"{scene}: {told['headline']}", *told["because"], f"Do first: {first}"]
    lines += [f"    {command}"] * bool(command)
    lines += [f"Tried: {one['text']}" for one in told["tried"]]
    lines += told["measured"]
    for level in report.LEVELS:
        named = [one["text"] for one in told["gauges"] if one["level"] == level]
        lines += [f"{level.capitalize()}: {', '.join(named)}"] * bool(named)
    lines.append("; ".join(f"{name}: {text}" for name, text in facts))
    return "\n".join(lines + [f"For other programs: {export}"] * (export is not None))
