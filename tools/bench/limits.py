"""The planted cases' evidence as a table, and limits of causes fitted to it.

    python -m tools.bench.limits collect results/planted --captures results/fox ...
        --out planted.csv
    python -m tools.bench.limits fit planted.csv --out FOLDER
    python -m tools.bench.limits stakes planted.csv
        --out alignerf/causes/shared/at_stake.yaml

Each case is read twice: as a training of ours, and as renders of another program.
Limits are fitted on all captures but one and judged by that one, in turn. What is at
stake is measured in limits: new limits ask for new stakes.
"""

import argparse
import contextlib
import json
import math
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pandas as pd
import yaml
from scipy import optimize, stats

from alignerf import causes
from alignerf.cameras import exposure as brightness
from alignerf.causes import base as of_causes
from alignerf.causes import (
    blur,
    coverage,
    exposure,
    lens,
    motion,
)
from alignerf.causes.shared import at_stake, misalignment
from alignerf.io import atomic, images, machine
from alignerf.metrics import pairs
from alignerf.scenes import prepare, prepared
from alignerf.sfm import matches
from alignerf.sfm.lens import Lens
from alignerf.verdict import evidence
from tools.bench import captures as captures_of
from tools.bench import faults, planted

JUDGED = of_causes.ExternalRenders("given", "known", "named like the photos")
TIMING = {"rays_seen": None}
# A fault that costs so much of the held-out score is to be named first.
STRONG_DB = 0.3
# What is fitted, {(module, name): where the fit starts}: limits of before these cases,
# so that no fit depends on a fit before it. Those of too few photos are not fitted, as
# no fault leaves photos out, nor those of flows alone, as all cases have matches.
LIMITS = {
    (misalignment, "MIN_DETAIL"): 0.5,
    (misalignment, "MIN_FINEST"): 0.5,
    (motion, "MOVED_FRACTION"): 0.05,
    (motion, "MOVED_ANYWAY"): 0.25,
    (lens, "SHIFT_PX"): 0.045,
    (lens, "LENS_PX"): 1.0,
    (lens, "LENS_FRACTION"): 0.4,
    (lens, "ALONE_FRACTION"): 0.8,
    (exposure, "EXPOSURE_EV"): 0.06,
    (exposure, "SHARED_EV"): 0.16,
    (exposure, "TONE_EV"): 0.1,
    (coverage, "FLOATER_VIEWS"): 0.04,
    (blur, "BLURRED_VIEWS"): 0.05,
}
# Faults that do not say what their cause costs by its size: cameras of other photos are
# off by any length, and copies change what held-out photos are.
UNSIZED = {"order", "copies"}
# Of so many cases and captures at the least a cost is fitted; and its range.
STAKE_CASES, STAKE_CAPTURES, STAKE_RANGE = 5, 4, (0.1, 0.9)
# What is counted, and so true.
FACTS = {"few_views", "unregistered"}
OUTCOME = ["capture", "reading", "seed", "faults", "strengths", "strong", "found"]
READ_AS = {"ours": "our training", "renders": "its renders"}
# Of a lens: its column, and what it is shown as.
LENSES = {
    "focal": ("focal_ratio", lambda times: times, lambda ratio: 1 / ratio),
    "principal point": ("centre_px", lambda px: px * 2**0.5, lambda px: px),
    "distortion": ("distortion_px", lambda px: px, lambda px: px),
    "rolling shutter": ("shutter_px", lambda px: px, lambda px: px),
}
FOUND = ("found", "found_low", "found_high")
FRACTIONS = {(lens, "LENS_FRACTION"), (lens, "ALONE_FRACTION")}
FACTORS, SWEEPS = 1.12 ** np.arange(-8, 9), 2
# Faults of splats, whose photos were left out.
OTHERS = {
    "few": ("few_views", "sparse"),
    "a phone's poses": ("camera", "lens_shift"),
    "a lost view": ("pairs", "floaters"),
}
# Of so many keypoints a pair's difference of levels is the median.
MIN_SHARED = 15
# Fine detail of a photo so wide: between these blurs, and around a pixel.
FINE_WIDTH_PX, FINE_PX, AROUND_PX = 800, (0.7, 1.6), 4.0


def collect(out, captures, known=None):
    """A row for each case and reading of it; known: a table that has some already."""
    keys = ["capture", "seed", "faults", "strengths"]
    there = set() if known is None else {*map(tuple, known[keys].astype(str).values)}
    cases = [
        (case, case.folder(out))
        for case in planted.cases(captures)
        if (case.folder(out) / planted.DONE).is_file()
        and tuple(map(str, shared_of(case).values())) not in there
    ]
    chosen = {case.capture for case, _ in cases}
    clean = {path: clean_photos(path) for path in chosen}
    own = {
        path: own_of(matched(path, out), clean[path], captures_of.own(path.name))
        for path in chosen
    }
    rows = machine.map_in_threads(
        lambda one: rows_of(*one, clean[one[0].capture], own[one[0].capture]),
        cases,
        threads=2,
    )
    return pd.concat([known, pd.DataFrame([row for each in rows for row in each])])


def shared_of(case):
    """What says which case a row is of."""
    return {
        "capture": case.capture.name,
        "seed": case.seed,
        "faults": "+".join(name for name, _ in case.plants),
        "strengths": "+".join(str(place) for _, place in case.plants),
    }


def matched(capture, out):
    """The matches of a capture without a fault."""
    return matches.load(planted.matched(capture, out) / "matches.npz")


def own_of(found, photos, seen=()):
    """The causes that are true of a capture as it is, by name, joined by spaces.

    found: matches in the photos {name: [h, w, 3]}. Neither renders nor depth are asked.
    seen: those that are known by other means.
    """
    levels, details = [], []
    for name, xy in zip(found.names, found.keypoints, strict=True):
        grey = photos[name].mean(-1, np.float32)
        x, y = np.minimum(np.floor(xy).astype(int), np.array(grey.shape[::-1]) - 1).T
        own = cv2.GaussianBlur(grey, (0, 0), brightness.SIGMA_PX)[y, x]
        known = (own > brightness.DARKEST) & (own < brightness.BRIGHTEST)
        levels.append(np.where(known, np.log2(np.maximum(own, 1.0)), np.nan))
        details.append(np.log2(detail(grey)[y, x]))
    stops, sharp = (over_photos(found, each) for each in (levels, details))
    soft = sharp - np.median(sharp) < np.log2(blur.BLURRED_DETAIL)
    true = {
        "exposure": np.std(stops) > exposure.SHARED_EV,
        "blurred": soft.mean() > blur.BLURRED_VIEWS,
    }
    return " ".join([*(name for name in true if true[name]), *seen])


def detail(grey):
    """Amplitude [h, w] of fine detail around each pixel of a grey photo."""
    scale = max(grey.shape[1] / FINE_WIDTH_PX, 1.0)
    fine, coarse = (cv2.GaussianBlur(grey, (0, 0), px * scale) for px in FINE_PX)
    power = cv2.GaussianBlur(np.square(fine - coarse), (0, 0), AROUND_PX * scale)
    return np.sqrt(np.maximum(power, 1e-3))


def over_photos(found, values):
    """By how much each photo's values are above the others', of what both show.

    values: of the keypoints of each photo; NaN where unknown.
    """
    rows, sides = [np.ones(len(values))], [0.0]
    for (i, j), index in zip(found.pairs, found.indices, strict=True):
        apart = values[j][index[:, 1]] - values[i][index[:, 0]]
        if np.isfinite(apart).sum() >= MIN_SHARED:
            rows.append(np.eye(len(values))[j] - np.eye(len(values))[i])
            sides.append(np.nanmedian(apart))
    return np.linalg.lstsq(rows, sides)[0]


def owned(row):
    """The causes of `own_of` in a row, as a set."""
    own = row.get("own")
    return set(own.split()) if isinstance(own, str) else set()


def rows_of(case, folder, clean, own_causes=""):
    """The rows of a case."""
    told = json.loads((folder / planted.DONE).read_text())
    shared = shared_of(case) | {"refused": told["refused"], "own": own_causes}
    if told["refused"]:
        return [shared | {"reading": "ours"}, shared | {"reading": "renders"}]
    shared["score_db"] = score_db(folder, clean)
    own = folder / "round0"
    rows = []
    for reading, scene in (("ours", folder), ("renders", as_renders(folder))):
        if reading == "ours" and any(
            faults.PLANTS[name].after for name, _ in case.plants
        ):
            continue
        known, _ = evidence.read(scene, scene / "round0", overfit=own / "overfit.csv")
        rows.append(shared | {"reading": reading} | flat(known))
    return rows


def clean_photos(capture):
    """{name: photo} of a capture."""
    names = prepared.read_cameras(capture / "cameras.npz")["names"].tolist()
    return {name: images.read(capture / "images" / f"{name}.png") for name in names}


def score_db(folder, clean):
    """Mean PSNR of held-out renders by the photos without a fault."""
    scores = []
    for path in sorted((folder / "round0" / "renders" / "test").glob("*.png")):
        photo, render = clean[path.stem.removesuffix("_copy")], images.read(path)
        photo = prepare.shrink(photo, *render.shape[1::-1])
        error = np.square((photo.astype(float) - render) / 255).mean()
        scores.append(-10 * math.log10(max(error, 1e-10)))
    return float(np.mean(scores))


def as_renders(folder):
    """The scene as `make judge` would have it: nothing of the training is known."""
    place = folder / "as_renders"
    base = place / "round0"
    base.mkdir(parents=True, exist_ok=True)
    (base / "timing.json").write_text(json.dumps(TIMING))
    told = json.loads((folder / "poses.json").read_text())
    told["external_renders"] = JUDGED._asdict()
    (place / "poses.json").write_text(json.dumps(told))
    links = [folder / name for name in ("images", "cameras.npz")]
    links += [one for one in (folder / "round0").iterdir() if one.name != "timing.json"]
    for one in links:
        link = (base if one.parent.name == "round0" else place) / one.name
        if not link.exists():
            link.symlink_to(one.resolve())
    return place


def flat(known):
    """An Evidence as cells of a table; {} of what it has not."""
    cells = {}
    for key, value in known._asdict().items():
        if key == "octaves":
            cells |= {f"octave_{i + 1}": one for i, one in enumerate(value)}
        elif key == "pairs":
            cells |= {"pairs_count": value.count, "pairs_wrong": len(value.faults)}
        elif key == "matches" and value:
            for name, one in value._asdict().items():
                if isinstance(one, Lens):
                    own = one._asdict() | {"changed": " ".join(one.changed)}
                    cells |= {f"{name}_{part}": v for part, v in own.items()}
                elif isinstance(one, tuple):
                    cells[f"matches_{name}"] = " ".join(one)
                elif one is not None:
                    cells[f"matches_{name}"] = one
        elif isinstance(value, int | float):
            cells[key] = value
    return {
        key: float(f"{value:.4g}") if isinstance(value, float) else value
        for key, value in cells.items()
    }


def evidence_of(row):
    """The `Evidence` of a row of the table."""
    known = {key: row[key] for key in of_causes.Evidence._fields if key in row}
    octaves = tuple(row[f"octave_{i}"] for i in range(1, 6))
    wrong, count = int(row["pairs_wrong"]), int(row["pairs_count"])
    checked = pairs.Checked(count, {str(i): ("swapped", "") for i in range(wrong)})
    known |= {"octaves": octaves, "pairs": checked, "crops": None, "by_colmap": None}
    depth = row.get("depth")
    judged = JUDGED._replace(depth=depth) if isinstance(depth, str) else JUDGED
    known["judged"] = judged if row["reading"] == "renders" else None
    known["matches"] = matches_of(row)
    whole = ("train_views", "test_views", "registered", "total", "copies")
    known |= {key: int(row[key]) for key in whole}
    return of_causes.Evidence(**known)


def matches_of(row):
    if not isinstance(row.get("matches_accepted"), bool | np.bool_):
        return None
    lenses = {}
    for name in ("lens", "left"):
        own = {key: row.get(f"{name}_{key}", math.nan) for key in Lens._fields}
        if math.isfinite(own["before_px"]):
            changed = own["changed"]
            own["changed"] = changed.split() if isinstance(changed, str) else []
            lenses[name] = Lens(**own)
    own = {
        key: row[f"matches_{key}"]
        for key in of_causes.Matches._fields
        if key not in ("lens", "left", "named", "kept")
    }
    own |= {key: bool(own[key]) for key in ("accepted", "applied")}
    # Older rows do not say it.
    kept = row.get("matches_kept")
    own["kept"] = tuple(kept.split()) if isinstance(kept, str) else ()
    return of_causes.Matches(**own | lenses)


def there_of(row):
    """The causes of each planted fault; any one of them names it."""
    names = row["faults"].split("+")
    return [
        OTHERS.get(name) or faults.PLANTS[name].causes
        for name in names
        if name != "nothing"
    ]


class Judged(NamedTuple):
    """What was found, in its order, of what is there; own: true of the capture."""

    found: list
    there: list
    own: set
    sure: list

    @property
    def first_is_right(self):
        """Whether what is planted comes first of what is not of the capture itself."""
        planted_ones = {name for own in self.there for name in own}
        passed = (FACTS | self.own) - planted_ones
        named = [name for name in self.found if name not in passed]
        return bool(named) and any(named[0] in own for own in self.there)

    @property
    def missed(self):
        return [own for own in self.there if not set(own) & set(self.found)]

    @property
    def right(self):
        return self.own.union(*self.there)

    @property
    def false(self):
        return [name for name in self.found if name not in self.right | FACTS]


def judged(case):
    """`Judged` of (Evidence or None where the capture was refused, there)."""
    known, there, own = case
    if known is None:
        # Nothing is trained by cameras that fit no photos: the line names them.
        return Judged(["camera"], there, own, ["camera"])
    found = causes.find(known)
    sure = [one.cause.name for one in found if one.sure]
    return Judged([one.cause.name for one in found], there, own, sure)


def loss_of(cases, strong):
    """How bad limits are: strong faults not named first, false causes, missed ones."""
    total = 0.0
    for case, is_strong in zip(cases, strong, strict=True):
        one = judged(case)
        total += len(one.false) + 0.1 * len(one.missed)
        total += bool(one.there) and is_strong and not one.first_is_right
    return total


def fitted(cases, strong):
    """{(module, name): value} by coordinate descent from LIMITS.

    Of the values that are equally good the one nearest to the start is taken.
    """
    now = dict(LIMITS)
    with restored():
        for key, value in now.items():
            setattr(*key, value)
        for _ in range(SWEEPS):
            for key in LIMITS:
                tried = [
                    min(factor * now[key], 0.95 if key in FRACTIONS else math.inf)
                    for factor in FACTORS
                ]
                losses = []
                for value in tried:
                    setattr(*key, value)
                    losses.append(loss_of(cases, strong))
                best = np.flatnonzero(np.isclose(losses, min(losses)))
                now[key] = tried[best[np.abs(best - len(tried) // 2).argmin()]]
                setattr(*key, now[key])
    return now


@contextlib.contextmanager
def restored():
    """The limits and what is at stake as they are now, again at the end."""
    before = {key: getattr(*key) for key in (*LIMITS, (at_stake, "fits"))}
    try:
        yield
    finally:
        for key, value in before.items():
            setattr(*key, value)


def left_out(table):
    """The table with what each row was judged by limits and stakes of all others."""
    cases = [of_row(row) for row in table.to_dict("records")]
    strong = is_strong(table)
    found = [None] * len(table)
    for capture in sorted(set(table["capture"])):
        own = (table["capture"] == capture).to_numpy()
        chosen = np.flatnonzero(~own)
        with restored():
            of_others = stakes(sized(table[~own]))
            at_stake.fits = lambda of_others=of_others: of_others
            limits = fitted([cases[i] for i in chosen], strong[chosen])
            for key, value in limits.items():
                setattr(*key, value)
            for i in np.flatnonzero(own):
                found[i] = judged(cases[i])
        print(
            capture,
            {f"{m.__name__}.{n}": round(v, 4) for (m, n), v in limits.items()},
            flush=True,
        )
    return found, strong


def as_they_are(table):
    """`left_out` by the limits that the program has."""
    return [judged(of_row(row)) for row in table.to_dict("records")], is_strong(table)


def outcomes(table, found, strong):
    """The table with columns of what was found, as `left_out` gives it."""
    sure = [{*one.sure} - FACTS for one in found]
    columns = {
        "strong": strong,
        "found": [", ".join(one.found) for one in found],
        "first_is_right": [one.first_is_right for one in found],
        "false": [len(one.false) for one in found],
        "missed": [len(one.missed) for one in found],
        "found_count": [len({*one.found} - FACTS - one.own) for one in found],
        "sure": list(map(len, sure)),
        "sure_right": [
            len(those & one.right) for those, one in zip(sure, found, strict=True)
        ],
    }
    if "trainer" not in table:
        table = table.assign(trainer=None)
    of_ours = table["reading"].map(READ_AS)
    read_as = table["trainer"].where(table["trainer"].notna(), of_ours)
    return table.assign(read_as=read_as, **columns)


def whole(table):
    """The limits that all captures together ask for."""
    cases = [of_row(row) for row in table.to_dict("records")]
    return fitted(cases, is_strong(table))


def of_row(row):
    refused = isinstance(row["refused"], str)
    known = None if refused else evidence_of(row)
    return known, there_of(row), owned(row)


def cost_of(table):
    """[n] dB of held-out PSNR that each case is below its capture without a fault.

    A capture may be there at two sizes of its photos.
    """
    same = ["capture", "photo_width_px"]
    own = table[table["faults"] == "nothing"]
    usual = own.groupby(same)["score_db"].mean().rename("usual_db")
    return table.join(usual, on=same)["usual_db"] - table["score_db"]


def sized(table):
    """Cases of one fault whose cause is found: cause, capture, size, cost_db.

    Of a fault that several causes name, the first that is looked for has it. Readings
    of one training are one case.
    """
    every, rows = {cause.name: cause for cause in causes.every()}, []
    keys = ["capture", "faults", "strengths", "seed"]
    own = table.assign(cost_db=cost_of(table)).dropna(subset="cost_db")
    for row in own.to_dict("records"):
        name = row["faults"]
        if name not in faults.PLANTS or name in UNSIZED:
            continue
        known = evidence_of(row)
        named = [one for one in faults.PLANTS[name].causes if one in every]
        looked = {one: every[one].find(known) for one in named}
        cause = next((one for one in named if looked[one]), None)
        if cause and looked[cause].sure is not None:
            kept = {key: row[key] for key in (*keys, "cost_db")}
            rows.append(kept | {"cause": cause, "size": looked[cause].size})
    keys = ["cause", *keys]
    cases = pd.DataFrame(rows, columns=[*keys, "size", "cost_db"])
    return cases.groupby(keys, as_index=False, sort=False).mean()


def stakes(cases):
    """{cause: what `at_stake.of_fit` wants} of `sized` cases.

    The range is that of costs over those which all other captures say.
    """
    found = {}
    for name, own in cases.groupby("cause"):
        captures = own["capture"].unique()
        if len(own) < STAKE_CASES or len(captures) < STAKE_CAPTURES:
            continue
        ratios = []
        for capture in captures:
            is_own = own["capture"] == capture
            others = {"low": 1, "high": 1} | monotone(own[~is_own])
            for row in own[is_own].itertuples():
                expected = at_stake.of_fit(others, row.size)[1]
                ratios.append(max(row.cost_db, 0.0) / max(expected, 0.1))
        low, high = np.quantile(ratios, STAKE_RANGE)
        ends = {"low": float(min(low, 1)), "high": float(max(high, 1))}
        found[name] = monotone(own) | ends
    return found


def monotone(own):
    """{sizes, db} of `sized` cases: the nearest costs that do not fall with size."""
    sizes, places, counts = np.unique(
        own["size"], return_inverse=True, return_counts=True
    )
    costs = np.bincount(places, own["cost_db"].clip(lower=0)) / counts
    fit = optimize.isotonic_regression(costs, weights=counts)
    steps = np.split(sizes, fit.blocks[1:-1])
    return {
        "sizes": [float(np.mean(step)) for step in steps],
        "db": fit.x[fit.blocks[:-1]].tolist(),
    }


def as_yaml(found):
    """The text of at_stake.yaml, to three digits."""

    def short(value):
        if isinstance(value, dict | list):
            pairs = value.items() if isinstance(value, dict) else enumerate(value)
            made = {key: short(one) for key, one in pairs}
            return made if isinstance(value, dict) else [*made.values()]
        return float(f"{value:.3g}")

    head = "# Made by `python -m tools.bench.limits stakes` of planted cases.\n"
    return head + yaml.safe_dump(short(found), default_flow_style=None, width=88)


def is_strong(table):
    """[n] whether a fault costs enough of the held-out score, or stops a judgement."""
    cost = cost_of(table)
    # What the capture has of itself is not told from what was planted.
    same = [
        any(set(causes_of) & owned(row) for causes_of in there_of(row))
        for row in table.to_dict("records")
    ]
    costs = table["refused"].notna() | (cost >= STRONG_DB)
    return costs.to_numpy() & ~np.array(same)


def by_capture(table):
    """A row for each capture and reading: how often it was judged rightly."""
    rows = []
    for (capture, read_as), own in table.groupby(["capture", "read_as"], sort=False):
        rows.append({"capture": capture, "read_as": read_as} | counted(own))
    rows += [
        {"capture": "all", "read_as": read_as} | counted(own)
        for read_as, own in table.groupby("read_as", sort=False)
    ]
    return pd.DataFrame(rows).convert_dtypes()


def by_fault(table):
    """A row for each fault alone and for two at once."""
    rows = []
    for name, own in table.groupby("faults", sort=False):
        row = {"fault": name.replace("+", " and "), "cases": len(own)}
        strong = own[own["strong"]]
        row |= {"strong": len(strong), "first": int(strong["first_is_right"].sum())}
        row |= {"missed": int(strong["missed"].sum()), "false": int(own["false"].sum())}
        row["advised"] = sum(map(is_advised, own.to_dict("records")))
        rows.append(row)
    return pd.DataFrame(rows)


def by_lens(table):
    """Lenses that were put in, and what matches alone say they are."""
    rows = []
    for name, (column, planted_as, found_as) in LENSES.items():
        own = table[(table["faults"] == name) & (table["read_as"] == "its renders")]
        for place, cases in own.groupby(own["strengths"].astype(int)):
            told = cases["lens_changed"].fillna("").str.contains(column.split("_")[0])
            values = found_as(cases[f"lens_{column}"][told])
            strength = faults.PLANTS[name].strengths[place]
            row = {"fault": name, "planted": planted_as(strength)}
            row |= {"captures": len(cases), "found_in": int(told.sum())}
            spread = values.quantile([0.5, 0, 1]) if len(values) else [math.nan] * 3
            rows.append(row | dict(zip(FOUND, spread, strict=True)))
    return pd.DataFrame(rows).round(4)


def by_splat(table):
    """Splats of other trainers, one by one."""
    own = table[table["trainer"].notna()]
    named = own["found"].replace("", "nothing").str.replace("_", " ")
    right = ~own["false"].astype(bool) & ~own["missed"].astype(bool)
    columns = {
        "splat": own["name"],
        "trainer": own["trainer"],
        "there": own["faults"].str.replace("+", ", "),
    }
    columns |= {"named": named, "right": right.map({True: "yes", False: "no"})}
    return pd.DataFrame(columns)


def counted(own):
    """What rows of the table come to, with intervals over captures in percent."""
    planted_ones = own["faults"] != "nothing"
    counts = {
        "first": own["first_is_right"][planted_ones & own["strong"]],
        "advised": pd.Series([*map(is_advised, own.to_dict("records"))], own.index),
        "quiet": own["found_count"][~planted_ones] == 0,
    }
    found = {"cases": len(own)}
    for name, right in counts.items():
        low, high = over_captures(right, own["capture"])
        found |= {name: int(right.sum()), f"{name}_of": len(right)}
        found |= {f"{name}_low": np.round(100 * low)}
        found |= {f"{name}_high": np.round(100 * high)}
    found |= {"false_each": round(own["false"].mean(), 3)}
    return found | {key: int(own[key].sum()) for key in ("sure", "sure_right")}


def is_advised(row):
    """Whether the first advice is on what is there: it is that on the first cause.

    What is counted and what the capture has of itself is there, too. Nothing has to be
    said of a fault that costs little.
    """
    first = row["found"].split(", ")[0]
    there = FACTS.union(owned(row), *there_of(row))
    return first in there if first else not (there_of(row) and row["strong"])


def over_captures(right, captures):
    """95 % interval of the share of `right` over captures drawn anew; else NaN.

    Student's, of a ratio whose captures have unlike counts. Where all captures agree it
    is Wilson's (1927) of as many cases as there are captures.
    """
    groups = right.groupby(captures)
    count, share = groups.ngroups, right.mean()
    if count < 2:
        return math.nan, math.nan
    off = groups.sum() - share * groups.count()
    if np.allclose(off, 0):
        agree = stats.binomtest(round(share * count), count)
        return tuple(agree.proportion_ci(method="wilson"))
    error = math.sqrt(count / (count - 1) * np.square(off).sum()) / len(right)
    reach = stats.t.ppf(0.975, count - 1) * error
    return max(share - reach, 0.0), min(share + reach, 1.0)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("collect", "fit", "stakes"))
    parser.add_argument("paths", type=Path, nargs="+")
    parser.add_argument("--captures", type=Path, nargs="+", default=[])
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(argv)
    captures_of.check_for_development(path.name for path in args.captures)
    if args.what == "collect":
        known = pd.read_csv(args.out, comment="#") if args.out.is_file() else None
        collect(args.paths[0], args.captures, known).to_csv(args.out, index=False)
        return
    table = pd.concat(
        [pd.read_csv(path, comment="#") for path in args.paths], ignore_index=True
    )
    captures_of.check_for_development(table["capture"])
    if args.what == "stakes":
        with atomic.replace_file(args.out) as path:
            path.write_text(as_yaml(stakes(sized(table))))
        return
    table = outcomes(table, *left_out(table))
    by_capture(table).to_csv(args.out / "verdicts.csv", index=False)
    by_fault(table).to_csv(args.out / "verdict_faults.csv", index=False)
    by_splat(table).to_csv(args.out / "splat_verdicts.csv", index=False)
    by_lens(table).to_csv(args.out / "lenses_found.csv", index=False)
    table[OUTCOME].to_csv(args.out / "outcomes.csv", index=False)
    named = {f"{m.__name__}.{n}": value for (m, n), value in whole(table).items()}
    print("of all captures:", json.dumps(named, indent=1))


if __name__ == "__main__":
    main()
