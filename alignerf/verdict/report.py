"""The verdict as one object: terminal, page and verdict.json show the same.

Its parts, in this order: VERDICT, what is wrong; DO FIRST, with a command where there
is one; TRIED, what this run's remedies brought; MEASURED; CHECKED AND FINE. Lengths are
in pixels of the original photo.
"""

import math
import re
import textwrap
from typing import NamedTuple

from alignerf.verdict import advice, causes, remedies, shift, words

# Of the terminal: where texts begin, and where they end.
INDENT, WIDTH = 10, 100
# A command in a text.
COMMAND = re.compile(r"`((?:make|snakemake|why-blurry|ns-|python) ?[^`]*)`")


class Report(NamedTuple):
    """What is told of a scene.

    headline: one sentence. because: a sentence for each cause that is named. do_first:
    {text, command}, the command may be None. tried: a mapping for each remedy of this
    run, see `tried_of`. measured: sentences. causes: a mapping for each cause that is
    looked for, also where it is fine, see `gauge`.
    """

    headline: str
    because: list
    do_first: dict
    tried: list
    measured: list
    causes: list


def of(e, findings, gains, views) -> Report:
    """The report. gains: of `remedies.of_table`; views: of `evidence.read_views`."""
    head = words.headline(e, findings)
    text = advice.advise(e, findings, gains)
    return Report(
        headline=head[0].upper() + head[1:],
        # What stops all others is the headline.
        because=[words.SENTENCES[one.cause](one, e) for one in findings]
        * (not e.pairs.stops),
        do_first=first(text),
        tried=[tried_of(gain, e) for gain in gains] * (not e.pairs.stops),
        measured=words.measured(e, views, gains),
        causes=[gauge(one, e, findings) for one in GAUGES if one.is_told(e)],
    )


def first(text):
    """{text, command}: a command that stands in the text is taken out of it."""
    found = COMMAND.search(text)
    whole = text[0].upper() + text[1:]
    if found is None:
        return {"text": whole, "command": None}
    return {"text": whole, "command": found[1]}


def without_command(do_first):
    """The text of what to do first; its command, shown apart, is pointed at."""
    return do_first["text"].replace(f"`{do_first['command']}`", "the command below")


def tried_of(gain, e):
    """{text, pays, db, low, high, minutes, test_set, method} of a remedy."""
    kept = ("db", "low", "high", "minutes", "test_set", "method")
    found = {key: getattr(gain, key) for key in kept}
    return {"text": remedies.line(gain, e), "pays": advice.pays(e, gain)} | found


class Gauge(NamedTuple):
    """A cause that is looked for.

    name: as people call it. value: a function of the evidence, in `unit`; NaN where it
    is unknown. limit: of the evidence too; beyond it the cause is named. untold: of the
    evidence, whether this run cannot tell the cause. is_told: whether it is looked for
    at all. says: what stands behind the name, of the evidence; None: value and limit.
    """

    cause: str
    name: str
    unit: str
    value: object
    limit: object
    untold: object = lambda e: False
    is_told: object = lambda e: True
    says: object = None


def of_alignment(e):
    """Whether renders are too blurred by a short training to tell a shift."""
    return shift.too_short(e) and not shift.known_windows(e)


def camera_value(e):
    """What shows that poses are off, in px of the photo."""
    if shift.known_windows(e):
        return e.windows.camera_px
    if causes.source_of_camera(e) == "matches":
        return e.matches.pose_error_px
    if causes.source_of_camera(e) == "points":
        return e.photo_px * e.reprojection_px
    return e.photo_px * e.camera_px


def camera_limit(e):
    if shift.known_windows(e):
        return shift.WINDOW_PX
    if causes.source_of_camera(e) == "points":
        return e.photo_px * causes.REPROJECTION_PX
    return e.photo_px * causes.PART_PX


def cannot_tell(e):
    if e.matches:
        return False
    return of_alignment(e) or not (shift.tells(e) or shift.misaligned(e))


GAUGES = (
    Gauge("camera", "camera poses", "px", camera_value, camera_limit, cannot_tell),
    Gauge(
        *("motion", "things that moved", "%"),
        lambda e: 100 * e.moved_share,
        lambda e: 100 * causes.MOVED_SHARE,
        of_alignment,
    ),
    Gauge(
        *("lens_shift", "principal point", "px"),
        lambda e: e.photo_px * e.shift_px,
        lambda e: e.photo_px * causes.SHIFT_PX,
        of_alignment,
    ),
    Gauge(
        *("lens_distortion", "lens distortion", "px"),
        lambda e: e.photo_px * e.distortion_px,
        lambda e: e.photo_px * causes.BEND_PX,
        of_alignment,
    ),
    Gauge(
        *("blurred", "blurred photos", "%"),
        lambda e: 100 * e.blurred_share,
        lambda e: 100 * causes.BLURRED_VIEWS,
    ),
    Gauge(
        *("exposure", "exposure", "stops"),
        lambda e: causes.exposure_of(e)[0],
        lambda e: causes.exposure_of(e)[1],
    ),
    Gauge(
        *("sparse", "held-out photos worse than learnt ones", "dB"),
        lambda e: e.psnr_train_db - e.psnr_test_db,
        lambda e: causes.GAP_DB,
        of_alignment,
    ),
    Gauge(
        *("few_views", "number of photos", "too few"),
        lambda e: max(shift.FEW_TRAIN_VIEWS - most_views(e), 0),
        lambda e: 0,
        says=lambda e: f"{most_views(e)}, {shift.FEW_TRAIN_VIEWS} are enough",
    ),
    Gauge(
        *("unregistered", "photos placed by COLMAP", "% left out"),
        lambda e: 100 * (1 - e.registered / max(e.total, 1)),
        lambda e: 100 * (1 - causes.REGISTERED),
        is_told=lambda e: not (e.poses_given or e.judged),
        says=lambda e: f"{e.registered} of {e.total}",
    ),
    Gauge(
        *("undertrained", "length of training", "passes"),
        lambda e: e.passes,
        lambda e: shift.FEW_PASSES,
        is_told=lambda e: not e.judged,
        says=lambda e: f"{number(e.passes)} passes, {shift.FEW_PASSES} are enough",
    ),
    Gauge(
        *("pairs", "renders of the right photos", "wrong"),
        lambda e: len(e.pairs.faults),
        lambda e: 0,
        is_told=lambda e: e.pairs.count > 0,
        says=lambda e: f"{len(e.pairs.faults) or 'none'} wrong of {e.pairs.count}",
    ),
)


def most_views(e):
    """Photos to learn from; of renders that are judged, those of the larger split."""
    return max(e.train_views, e.test_views) if e.judged else e.train_views


def gauge(one: Gauge, e, findings):
    """{cause, name, level, value, limit, unit, text} of a cause.

    level: `sure` or `likely` where it is named, `not seen`, or `untold` where this run
    cannot tell.
    """
    named = {finding.cause: finding for finding in findings}
    value, limit = float(one.value(e)), float(one.limit(e))
    if one.cause in named:
        level = "sure" if named[one.cause].sure else "likely"
    else:
        unknown = one.untold(e) or not math.isfinite(value) or e.pairs.stops
        level = "untold" if unknown else "not seen"
    says = f"{number(value)} of {number(limit)} {one.unit}"
    if one.says is not None:
        says = one.says(e)
    elif level == "not seen" and value > limit:
        says = f"{number(value)} {one.unit}, within its error"
    return {
        "cause": one.cause,
        "name": one.name,
        "level": level,
        "value": value,
        "limit": limit,
        "unit": one.unit,
        "text": f"{one.name} ({says})",
    }


def number(value):
    """Two digits that count; a whole number as it is."""
    if not math.isfinite(value):
        return "unknown"
    return (
        f"{value:.0f}" if abs(value) >= 9.5 or value == int(value) else f"{value:.2g}"
    )


def terminal(report: Report):
    """Lines of the report, folded for a terminal."""
    do_first = [without_command(report.do_first)]
    if command := report.do_first["command"]:
        do_first.append(f"    {command}")
    by_level = {level: [] for level in ("not seen", "untold")}
    for one in report.causes:
        by_level.get(one["level"], []).append(one["text"])
    fine = [f"{', '.join(by_level['not seen'])}."] if by_level["not seen"] else []
    names = [one["name"] for one in report.causes if one["level"] == "untold"]
    parts = {
        "VERDICT": [report.headline, *report.because],
        "DO FIRST": do_first,
        "TRIED": [one["text"] for one in report.tried],
        "MEASURED": report.measured,
        "FINE": fine,
        "NOT TOLD": [f"{', '.join(names)}."] if names else [],
    }
    return [line for title, texts in parts.items() for line in folded(title, texts)]


def folded(title, texts):
    """Lines of one part, its title before the first."""
    lines = []
    for text in texts:
        # A command has to stay in one piece.
        if text.startswith("    "):
            lines.append(text)
        else:
            lines += textwrap.wrap(text, WIDTH - INDENT, break_on_hyphens=False)
    heads = [title, *[""] * len(lines)]
    return [f"{h:<{INDENT}}{line}" for h, line in zip(heads, lines, strict=False)]
