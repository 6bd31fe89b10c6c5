"""The verdict as one object: terminal, page and verdict.json show the same.

Its parts, in this order: VERDICT, what is wrong; DO FIRST, with a command where there
is one; TRIED, what this run's fixes brought; MEASURED; OK; CANNOT TELL. Lengths are in
pixels of the original photo.
"""

import math
import re
import textwrap

from alignerf import causes, testsets
from alignerf.causes import camera, coverage, motion, remedies, shift
from alignerf.causes.base import amount, length
from alignerf.io import provenance
from alignerf.metrics import pairs
from alignerf.verdict import kinds, measured

# Of the terminal: where texts begin, and where they end.
INDENT, WIDTH = 13, 100
# A command in a text.
COMMAND = re.compile(r"`((?:make|snakemake|why-blurry|ns-|python) ?[^`]*)`")
# From this place among advice on, photos are to be taken.
MORE_PHOTOS = 8
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


def of(e, findings, gains, views):
    """What is told of a scene: {key: text, or what is in it}.

    gains: of `gains.of_table`; views: of `evidence.read_views`. state: `aligned`,
    `misaligned` or `unclear`. headline: one sentence. because: a sentence for each
    cause that is named. do_first: {text, command}, the command may be None. tried: of
    each fix of this run. measured: sentences. causes: of each cause that is looked
    for, also where it is fine, see `gauge`.
    """
    head = headline(e, findings)
    text = advise(e, findings, gains)
    command = COMMAND.search(text)
    told, spoilt = not e.pairs.stops, causes.spoilt(e, findings)
    return {
        "state": state(e, findings),
        "headline": head[0].upper() + head[1:],
        # What stops all others is the headline.
        "because": [finding.sentence(e) for finding in findings] * told,
        "do_first": {
            "text": text[0].upper() + text[1:],
            "command": command and command[1],
        },
        "tried": [tried(gain, e) for gain in gains] * told,
        "measured": measured.sentences(e, views, gains),
        "causes": [
            gauge(cause, e, findings, spoilt.get(cause.name))
            for cause in causes.every()
            if cause.looked_for(e)
        ],
    }


def state(e, findings):
    """The verdict in a word: `aligned`, `misaligned` or `unclear`."""
    if e.pairs.stops:
        return "unclear"
    off = e.judged and shift.poses_off(e) and shift.misaligned(e)
    # What matches say needs no shape that photos fix.
    if shift.by_crops(e) or off:
        return "misaligned"
    if is_sparse(findings) or shift.few_train(e) or not shift.is_sharp(e):
        return "unclear"
    if shift.misaligned(e) and not shift.too_short(e):
        return "misaligned"
    # What another cause explains may still be there.
    fits = not coverage.SPARSE.find(e)
    return "aligned" if shift.tells(e) and fits else "unclear"


def is_sparse(findings, *, surely=False):
    """Whether photos are named as too few, or too far apart, to fix a shape."""
    return any(f.cause is coverage.SPARSE and f.sure >= surely for f in findings)


def headline(e, findings):
    """One line: aligned or not, by how much, and the gravest causes."""
    if e.pairs.stops:
        return f"cannot be told: {pairs.sentence(e.pairs)}."
    kind, called = state(e, findings), ", ".join(one.called for one in findings)
    if kind == "misaligned":
        by = f"misaligned by {length(shift.shift_px(e))}"
        return f"{by}{called and ': ' + called}."
    if kind == "aligned":
        far = f"aligned, as far as {length(shift.limit_px(e))} can show"
        return f"{far}{called and '; but ' + called}."
    if is_sparse(findings):
        for one in findings:
            if one.cause.seen_by_points:
                return f"{one.called}, and photos are too few or too far apart."
        return "too few photos, or too far apart: alignment does not help."
    if shift.few_train(e):
        return "too few photos to say much."
    if shift.too_short(e):
        return "trained too short to tell how well photos are aligned."
    also = called and f" But {called}."
    if not math.isfinite(shift.flow_px(e)):
        return f"cannot be told: no flow from renders to photos is valid.{also}"
    if shift.of_crops_say(e) == "unconfirmed":
        px = length(e.crops.flow_px)
        return f"cannot be told for sure: crops are {px} apart.{also}"
    if coverage.SPARSE.find(e):
        return (
            f"cannot be told: held-out photos are far worse than training photos.{also}"
        )
    seen = f"a misalignment under {length(shift.limit_px(e))} would not be seen"
    return f"cannot be told at this size: {seen}.{also}"


def advise(e, findings, gains=()):
    """The fix to try first; never one that this run has tried in vain."""
    if e.pairs.stops:
        return pairs.advice(e.pairs)
    if is_sparse(findings, surely=True) and not e.judged:
        # What is only probable then is seen by bad renders; poses are by points, too.
        findings = [one for one in findings if one.sure or one.cause.seen_by_points]
    for cause, *_ in sorted(findings, key=place_of_advice):
        text = cause.advice_external if e.judged else cause.advice
        said = text(e, gains) if callable(text) else text
        if said := with_export(e, said) if e.judged else said:
            return said
    if e.judged:
        return of_judged_alignment(e)
    if remedies.warped_in_vain(e, gains):
        return "leave the photos as they are: warping them brought no significant gain."
    misaligned = shift.misaligned(e)
    if tried := remedies.advise(e, gains, only_paying=not misaligned):
        return tried
    if misaligned:
        return f"{camera.text(e)} The cause is unknown: look at the residual flow."
    if not shift.tells(e):
        return {None: UNSEEN, "few": WIDER}.get(shift.of_crops_say(e), LARGER)
    return "nothing about alignment. For sharper renders train for more steps."


def place_of_advice(finding):
    """What is sure comes before what is probable, and more photos after all else."""
    place = finding.cause.order[2]
    return place >= MORE_PHOTOS, not finding.sure, place


def of_judged_alignment(e):
    """What to do about renders of another program of which no cause is named."""
    if shift.misaligned(e):
        return with_export(e, motion.CAUSE.advice_external)
    if not shift.tells(e):
        return (
            "render larger images: at this size a misalignment is too small to be seen."
        )
    if coverage.SPARSE.find(e):
        return coverage.SPARSE.advice_external
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
    interval = f"[{gain.low:+.2f}, {gain.high:+.2f}]"
    if not math.isfinite(gain.low + gain.high):
        interval = "(no interval)"
    parts = [f"{gain.name}: {gain.db:+.2f} dB {interval} {against}".strip()]
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
    if e.test_views < shift.FEW_TEST_VIEWS:
        notes.append(f"{e.test_views} held-out photos are too few to be sure")
    elif not (gain.low > 0 or gain.high < 0):
        notes.append("not significant")
    told = {"text": f"{'; '.join(parts + notes)}.", "pays": remedies.pays(e, gain)}
    kept = ("name", "db", "low", "high", "test_set", "method")
    told |= {key: getattr(gain, key) for key in kept}
    return told | {"seconds": took_s(gain), "matches": matches, "notes": notes}


def took_s(gain):
    """Whole seconds that a fix took, all before it included."""
    return round(60 * gain.minutes)


def gauge(cause, e, findings, spoilt=None):
    """{cause, name, level, value, limit, unit, measured, allowed, note, page, text}.

    level: `faulty` or `likely` where it is named, `ok`, or `cannot tell`, as where
    another cause explains what would show it.
    """
    scale = cause.scale(e)
    value, limit = float(scale * cause.value(e)), float(scale * cause.limit(e))
    sure = {finding.cause: finding.sure for finding in findings}
    if cause in sure:
        level = FAULTY if sure[cause] else LIKELY
    else:
        unknown = not (cause.detectable(e) and math.isfinite(value))
        unknown |= bool(spoilt or e.pairs.stops)
        level = UNKNOWN if unknown else OK
    measured = cause.says(e) if cause.says else amount(value, cause.unit)
    bound = amount(limit, cause.unit)
    if not cause.says:
        # The unit stands beside what was measured.
        bound = bound.removesuffix(f" {cause.unit}")
    allowed = f"{'from' if cause.more_is_better else 'up to'} {bound}"
    allowed = allowed if limit or cause.more_is_better else "none"
    note = ""
    if spoilt and level == UNKNOWN:
        note = f"{CANNOT_TELL} {spoilt.cause.spoils}"
    elif level == OK and (value < limit if cause.more_is_better else value > limit):
        # Views do not agree on it, or matches deny it.
        note = "not significant"
    said = f"{measured}; {note or f'fine: {allowed}'}"
    return {
        "cause": cause.name,
        "name": cause.label,
        "level": level,
        "value": value,
        "limit": limit,
        "unit": cause.unit,
        "more_is_better": cause.more_is_better,
        "measured": measured,
        "allowed": allowed,
        "note": note,
        "page": cause.page,
        "text": f"{cause.label} ({note if level == UNKNOWN else said})",
    }


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
