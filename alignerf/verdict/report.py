"""The verdict as one object: terminal, page and verdict.json show the same.

Its parts, in this order: VERDICT, what is wrong; DO FIRST, with a command where there
is one; TRIED, what this run's fixes brought; MEASURED; OK; CANNOT TELL. Lengths are in
pixels of the original photo.
"""

import math
import re
import textwrap

from alignerf import causes, testsets
from alignerf.causes import base, camera, coverage, lens, motion
from alignerf.causes.base import amount, length
from alignerf.causes.shared import at_stake, misalignment, remedies
from alignerf.io import provenance
from alignerf.metrics import pairs
from alignerf.verdict import kinds, measured

# Of the terminal: where texts begin, and where they end.
INDENT, WIDTH = 13, 100
# Causes that count photos: none is what misaligns.
COUNTS = coverage.FEW_VIEWS, coverage.UNREGISTERED
# Standard errors of what flows say of the lens.
ERRORS = {lens.SHIFT: "shift_errors", lens.DISTORTION: "distortion_errors"}
# Of an interval so wide a hundredth says nothing.
WIDE_DB = 0.5
# A command in a text.
COMMAND = re.compile(r"`((?:make|snakemake|why-blurry|ns-|python) ?[^`]*)`")
LEVELS = FAULTY, LIKELY, OK, UNKNOWN = kinds.LEVELS
# How a gauge begins whose evidence another cause spoils.
CANNOT_TELL = "cannot tell, because"
# Where alignment cannot be told: without crops; with them; with too few of them.
UNSEEN = "add `crops: {}` to the config, or make photos less small (downscale)."
LARGER = "make photos less small (downscale), or train crops longer (crops.steps)."
WIDER = (
    "cut more crops of each photo, `crops: { count: 4 }` in the config, until five "
    "held-out photos have one; or make photos less small (downscale)."
)


def of(e, views):
    """What is told of a scene: {key: text, or what is in it}.

    views: of `evidence.read_views`. state: `aligned`, `misaligned` or `unclear`.
    headline: one sentence. because: a sentence for each cause that is named. do_first:
    {text, command}, the command may be None. tried: of each fix of this run. measured:
    sentences. findings: of each cause that is named, in the order of `causes.examine`.
    causes: of each cause that is looked for, also where it is fine, see `gauge`.
    """
    examined = causes.examine(e)
    named = [one for one in examined if one.sure is not None]
    head, text = headline(e, named), advise(e, named)
    command = COMMAND.search(text)
    told = not e.pairs.stops
    return {
        "state": state(e, named),
        "headline": head[0].upper() + head[1:],
        # What stops all others is the headline.
        "because": [f"{one.sentence} {at_stake.said(one)}" for one in named] * told,
        "do_first": {
            "text": text[0].upper() + text[1:],
            "command": command and command[1],
        },
        "tried": [tried(gain, e) for gain in e.tried] * told,
        "measured": measured.sentences(e, views),
        "findings": [
            {key: getattr(one, key) for key in ("value", "sure", "photos")}
            | {"cause": one.cause.name}
            | {"at_stake_db": one.at_stake and list(one.at_stake[::2])}
            for one in named
        ],
        "causes": [gauge(one, e) for one in examined],
    }


def state(e, named):
    """The verdict in a word: `aligned`, `misaligned` or `unclear`."""
    if e.pairs.stops:
        return "unclear"
    off = e.judged and misalignment.poses_off(e) and misalignment.misaligned(e)
    # What matches say needs no shape that photos fix.
    if misalignment.by_crops(e) or off:
        return "misaligned"
    few = of_cause(coverage.SPARSE, named) or misalignment.few_train(e)
    if few or not misalignment.is_sharp(e):
        return "unclear"
    if misalignment.misaligned(e) and not misalignment.too_short(e):
        return "misaligned"
    # What another cause explains may still be there.
    fits = not coverage.is_sparse(e)
    return "aligned" if misalignment.tells(e) and fits else "unclear"


def of_cause(cause, named):
    """The Finding of a cause among those that are named; else None."""
    return next((one for one in named if one.cause is cause), None)


def headline(e, named):
    """One line: aligned or not, by how much, and the causes."""
    if e.pairs.stops:
        return f"cannot be told: {pairs.sentence(e.pairs)}."
    kind, called = state(e, named), ", ".join(one.called for one in named)
    if kind == "misaligned":
        return f"blurry because {misaligned(e, named)}.{corrected(e)}"
    if kind == "aligned":
        far = f"aligned, as far as {length(misalignment.limit_px(e))} can show"
        return f"{far}{called and '; but ' + called}."
    if of_cause(coverage.SPARSE, named):
        if poses := of_cause(camera.CAUSE, named):
            return f"{poses.called}, and photos are too few or too far apart."
        return "too few photos, or too far apart: alignment does not help."
    if misalignment.few_train(e):
        return "too few photos to say much."
    if misalignment.too_short(e):
        return "trained too short to tell how well photos are aligned."
    also = called and f" But {called}."
    if not math.isfinite(misalignment.flow_px(e)):
        return f"cannot be told: no flow from renders to photos is valid.{also}"
    if misalignment.of_crops_say(e) == "unconfirmed":
        px = length(e.crops.flow_px)
        return f"cannot be told for sure: crops are {px} apart.{also}"
    if coverage.is_sparse(e):
        return (
            f"cannot be told: held-out photos are far worse than training photos.{also}"
        )
    seen = f"a misalignment under {length(misalignment.limit_px(e))} would not be seen"
    return f"cannot be told at this size: {seen}.{also}"


def misaligned(e, named):
    """By what photos are misaligned: causes in their order, counts of photos last."""
    poses, px = of_cause(camera.CAUSE, named), length(misalignment.shift_px(e))
    order = sorted(named, key=lambda one: one.cause in COUNTS)
    by = {camera.CAUSE: f" by {length(poses.value)}"} if poses else {}
    called = ", ".join(one.called + by.get(one.cause, "") for one in order)
    if poses:
        return called
    return f"{called}: misaligned by {px}" if called else f"misaligned by {px}"


def correction(e):
    """The gain of the corrected cameras that bring most, where some do; else None."""
    known = [one for one in e.tried if one.in_loop and remedies.pays(e, one)]
    best = max(known, key=lambda one: one.db, default=None)
    return best if best and best.low > 0 else None


def corrected(e):
    """What corrected cameras bring, where this run says so; else nothing."""
    if (best := correction(e)) is None:
        return ""
    db, *ends = spoken(best.db, best.low, best.high)
    return f" Corrected: {db} dB ({' to '.join(ends).replace('+', '')})."


def spoken(*values):
    """Gain and ends of its interval in dB, in tenths where the interval is wide."""
    wide = values[2] - values[1] >= WIDE_DB and min(map(abs, values)) >= 0.05
    return [f"{value:+.{1 if wide else 2}f}" for value in values]


def advise(e, named):
    """The first cause's advice; never what this run has tried in vain."""
    if named:
        said = named[0].told(external=bool(e.judged))
        return with_export(e, said) if e.judged else said
    if e.judged:
        return of_judged_alignment(e)
    if said := remedies.warped_in_vain(e):
        return said
    misaligned = misalignment.misaligned(e)
    if said := remedies.advise(e, only_paying=not misaligned):
        return said
    if misaligned:
        return f"{camera.align(e)} The cause is unknown: look at the residual flow."
    if not misalignment.tells(e):
        return {None: UNSEEN, "few": WIDER}.get(misalignment.of_crops_say(e), LARGER)
    return "nothing about alignment. For sharper renders train for more steps."


def of_judged_alignment(e):
    """What to do about renders of another program of which no cause is named."""
    if misalignment.misaligned(e):
        return with_export(e, motion.CAUSE.advice_external)
    if not misalignment.tells(e):
        return (
            "render larger images: at this size a misalignment is too small to be seen."
        )
    if coverage.is_sparse(e):
        return coverage.SPARSE.advice
    return (
        "nothing about alignment. For sharper renders train longer, or a larger model."
    )


def with_export(e, text):
    """An advice with the command that exports, or with what an export wants first."""
    if "{export}" not in text:
        return text
    if e.judged.cameras == "none":
        return "give the cameras, too (CAMERAS=...): then they can be corrected."
    if not e.train_views:
        return (
            "render the training photos, too, and judge again: "
            "only those can be corrected."
        )
    return text.format(export=provenance.export_command())


def tried(gain, e):
    """What a fix brought: its sentence claims nothing from few views."""
    took = f"{gain.minutes:.0f} min" if gain.minutes >= 2 else f"{took_s(gain)} s"
    against = testsets.against(gain.test_set)
    db, low, high = spoken(gain.db, gain.low, gain.high)
    is_known = math.isfinite(gain.low + gain.high)
    interval = f"[{low}, {high}]" if is_known else "(no interval)"
    parts = [f"{gain.name}: {db} dB {interval} {against}".strip()]
    parts[0] += f", {took}"
    matches = ""
    if gain.matches and gain.matches["accepted"]:
        matches = "{before_px:.2f} -> {after_px:.2f} px".format(**gain.matches)
        parts.append(f"held-out matches {matches}")
    notes = []
    if gain.in_loop and testsets.is_unfair(gain.test_set, {"cameras"}):
        notes.append("judged by the input cameras, so that the true gain is larger")
    if gain.cameras_moved == 0:
        notes.append("no camera moved")
    if e.test_views < misalignment.FEW_TEST_VIEWS:
        notes.append(f"{e.test_views} held-out photos are too few to be sure")
    elif not (gain.low > 0 or gain.high < 0):
        notes.append("not significant")
    told = {"text": f"{'; '.join(parts + notes)}.", "pays": remedies.pays(e, gain)}
    kept = ("name", "db", "low", "high", "test_set", "method")
    told |= {key: getattr(gain, key) for key in kept}
    told |= {"seconds": took_s(gain), "matches": matches, "notes": notes}
    return told | {"in_headline": gain is correction(e)}


def took_s(gain):
    """Whole seconds that a fix took, all before it included."""
    return round(60 * gain.minutes)


def gauge(one, e):
    """{cause, name, level, value, limit, unit, measured, allowed, note, page, text}.

    one: a `base.Finding`. Its level is `cannot tell` also where another cause explains
    what would show it, and where a value beyond its limit is not significant.
    """
    seen_px = misalignment.limit_px(e)
    if one.cause is camera.CAUSE and (one.sure is None or one.value > seen_px):
        # One limit: what is shorter cannot be seen.
        one = one._replace(limit=max(one.limit, seen_px))
    cause, level = one.cause, level_of(one)
    unit = one.unit or cause.unit
    bound = amount(one.limit, unit)
    if not one.measured:
        # The unit stands beside what was measured.
        bound = bound.removesuffix(f" {unit}")
    allowed = f"{'from' if one.more_is_better else 'up to'} {bound}"
    allowed = allowed if one.limit or one.more_is_better else "none"
    measured = one.measured or amount(one.value, unit)
    note = f"{CANNOT_TELL} {one.spoilt}" if one.spoilt else ""
    if not note and level == UNKNOWN:
        note = why_unknown(one, e, measured)
    said = note if level == UNKNOWN else f"{measured}; {note or f'fine: {allowed}'}"
    return {
        "cause": cause.name,
        "name": cause.label,
        "level": level,
        "value": float(one.value),
        "limit": float(one.limit),
        "unit": unit,
        "more_is_better": one.more_is_better,
        "measured": measured,
        "allowed": allowed,
        "note": note,
        "page": cause.page,
        "text": f"{cause.label} ({said})" if said else cause.label,
    }


def why_unknown(one, e, measured):
    """Why a cause cannot be told by what was measured of it."""
    if not math.isfinite(one.value):
        return "not measured"
    if not (one.detectable and is_beyond(one)):
        return f"{measured}, too uncertain"
    errors = getattr(e, ERRORS.get(one.cause, ""), math.nan)
    if 0 < errors <= lens.LENS_ERRORS:
        bound = length(lens.LENS_ERRORS * one.value / errors)
        return f"{measured.removesuffix(' px')} \u00b1 {bound}: not different from 0"
    denied = one.cause in ERRORS and lens.is_asked(e)
    denied |= one.cause is camera.CAUSE and camera.denied(e) is True
    return f"{measured}, {'denied by matches' if denied else 'not significant'}"


def level_of(one):
    """Of LEVELS, of a `base.Finding`."""
    if one.sure is not None:
        return FAULTY if one.sure else LIKELY
    told = one.detectable and not one.spoilt and math.isfinite(one.value)
    return OK if told and not is_beyond(one) else UNKNOWN


def is_beyond(one):
    """Whether a `base.Finding`'s value is on the wrong side of its limit."""
    found = base.beyond(one.value, one.limit, more_is_better=one.more_is_better)
    return found.sure is not None


def without_command(do_first):
    """The text of what to do first; its command, shown apart, is pointed at."""
    return do_first["text"].replace(f"`{do_first['command']}`", "the command below")


def terminal(told):
    """Lines of what `of` tells, folded for a terminal."""
    do_first, command = told["do_first"], told["do_first"]["command"]
    fine = ", ".join(one["text"] for one in told["causes"] if one["level"] == OK)
    untold = "; ".join(untold_of(told["causes"]))
    parts = {
        "VERDICT": [told["headline"], *told["because"]],
        "DO FIRST": [without_command(do_first), *[f"    {command}"] * bool(command)],
        "TRIED": [one["text"] for one in told["tried"]],
        "MEASURED": told["measured"],
        "OK": [f"{fine}."] * bool(fine),
        "CANNOT TELL": [f"{untold}."] * bool(untold),
    }
    return [line for title, texts in parts.items() for line in folded(title, texts)]


def untold_of(gauges):
    """What is not told, by why it is not."""
    names = {}
    for one in gauges:
        if one["level"] == UNKNOWN:
            names.setdefault(one["note"], []).append(one["name"])
    return [", ".join(own) + f": {why}" * bool(why) for why, own in names.items()]


def folded(title, texts):
    """Lines of one part, its title before the first."""
    lines = []
    for text in texts:
        # A command has to stay in one piece.
        is_command = text.startswith("    ")
        wrapped = textwrap.wrap(text, WIDTH - INDENT, break_on_hyphens=False)
        lines += [text] if is_command else wrapped
    heads = [title, *[""] * len(lines)]
    return [f"{h:<{INDENT}}{line}" for h, line in zip(heads, lines, strict=False)]
