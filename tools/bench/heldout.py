"""The one look at captures that the rules never saw, once for each release of them.

    python -m tools.bench.heldout results/planted --captures results/beer ...
        --out docs/measured

results/planted: their finished cases, as `tools.bench.planted` makes them. Writes
verdicts_heldout.csv and verdict_faults_heldout.csv, beside what verdicts.csv and
verdict_faults.csv say of the captures for development, and adds the look to
heldout_looks.csv. The rules are known by a digest. With those of the last look nothing
is done; others are refused until `release` in captures.yaml is raised: so each look is
on record.
"""

import argparse
import datetime
import hashlib
import os
from pathlib import Path

import pandas as pd

from alignerf.io import atomic, provenance
from tools.bench import captures, faults, limits, measure, planted

LOOKS, BY_CAPTURE = "heldout_looks.csv", "verdicts_heldout.csv"
BY_FAULT, SPLATS = "verdict_faults_heldout.csv", "splat_verdicts_heldout.csv"
RECORDED = provenance.ROOT / "tests/alignerf/causes/planted.csv"
# A finished case in the folder of a capture.
DONE = f"*/{planted.DONE}"
# What measures evidence, and what decides by it.
MEASURES = ("verdict", "metrics", "cameras", "sfm", "keypoints")
MEASURES = (*(f"alignerf/{name}" for name in MEASURES), "flow")
RULES = ("alignerf/causes", *MEASURES)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=Path)
    parser.add_argument("--captures", type=Path, nargs="+", required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument(
        "--incomplete",
        action="store_true",
        help="judge those cases that there are, though other captures have more",
    )
    parser.add_argument(
        "--collect", action="store_true", help="measure, judge nothing: no look"
    )
    parser.add_argument(
        "--splats", type=Path, help="rows of tools.bench.splat_cases, judged beside"
    )
    args = parser.parse_args(argv)
    names = {path.name for path in args.captures}
    if wrong := names ^ captures.of(captures.HELD_OUT):
        every = ", ".join(sorted(wrong))
        raise SystemExit(f"--captures: all that are held out, at once: {every}")
    if args.collect:
        evidence_of(args.cases, args.captures)
        return
    if provenance.commit().endswith("-dirty"):
        raise SystemExit("commit the rules first: a look is of what is on record")
    rules, looks = measure.digest(*RULES), looks_of(args.out / LOOKS)
    if is_done(looks, captures.RELEASE, rules):
        print(f"release {captures.RELEASE} was looked at: {args.out / LOOKS}")
        return
    if (missing := missing_of(args.cases, args.captures)) and not args.incomplete:
        raise SystemExit(f"cases that others have: {', '.join(missing)}")
    table = evidence_of(args.cases, args.captures)
    table = limits.outcomes(table, *limits.as_they_are(table))
    by_capture = beside_captures(limits.by_capture(table), args.out)
    look = {"release": captures.RELEASE, "digest": rules, "outcomes": outcomes()}
    look |= {"looked": datetime.date.today().isoformat()}
    every = by_capture[by_capture["capture"] == "all"].drop(columns="capture")
    head = measure.head(
        "python -m tools.bench.heldout results/planted --captures RESULTS --out FOLDER",
        f"{os.cpu_count()} cores of a shared machine",
    )
    made = {
        BY_CAPTURE: by_capture.assign(release=captures.RELEASE),
        BY_FAULT: beside_faults(limits.by_fault(table), args.out),
        LOOKS: pd.concat([looks, every.assign(**look)]),
    }
    if args.splats:
        made[SPLATS] = of_splats(pd.read_csv(args.splats))
    for name, table in made.items():
        with atomic.replace_file(args.out / name) as path:
            path.write_text(head + table.convert_dtypes().to_csv(index=False))


def looks_of(path):
    """The looks that there were, a row for each role and reading."""
    if not path.is_file():
        return pd.DataFrame(columns=["release", "digest"])
    return pd.read_csv(path, comment="#", dtype={"digest": str, "outcomes": str})


def is_done(looks, release, rules):
    """Whether this release was looked at; other rules need a higher number."""
    own = looks[looks["release"] == release]
    if len(own) and {*own["digest"]} == {rules}:
        return True
    if len(own) or (looks["release"] > release).any():
        last = looks.iloc[-1]
        raise SystemExit(
            f"{LOOKS}: the rules {last['digest']} of release {last['release']} were "
            f"looked at, and these are {rules}: raise `release` in "
            "tools/bench/captures.yaml for another look"
        )
    return False


def missing_of(cases, folders):
    """capture/case of finished cases that a capture lacks and another has."""
    done = {
        folder.name: {path.parent.name for path in (cases / folder.name).glob(DONE)}
        for folder in folders
    }
    every = set().union(*done.values())
    return [f"{name}/{case}" for name in done for case in sorted(every - done[name])]


def evidence_of(cases, folders):
    """The rows of `limits.collect`, kept beside the cases until others measure them."""
    path = cases / f"heldout_{measure.digest(*MEASURES)}.csv"
    table = pd.read_csv(path) if path.is_file() else None
    for folder in folders:
        table = limits.collect(cases, [folder], table)
        with atomic.replace_file(path) as temporary:
            table.to_csv(temporary, index=False)
    return pd.read_csv(path)


def of_splats(rows):
    """`limits.by_splat` of splats of held-out captures."""
    if others := {*rows["capture"]} - captures.of(captures.HELD_OUT):
        raise SystemExit(f"--splats: not held out: {', '.join(sorted(others))}")
    found = [limits.judged(limits.of_row(row)) for row in rows.to_dict("records")]
    return limits.by_splat(limits.outcomes(rows, found, strong=False))


def beside_captures(found, out):
    """`limits.by_capture` of held-out captures, above what all for development say."""
    theirs = measured(out, "verdicts")
    theirs = theirs[theirs["capture"] == "all"]
    found = [found.assign(role="held out"), theirs.assign(role="development")]
    both = pd.concat(found)
    return both[both["read_as"].isin(limits.READ_AS.values())]


def beside_faults(found, out):
    """`limits.by_fault`, and the same faults in captures for development."""
    theirs = measured(out, "verdict_faults").set_index("fault")
    both = found.set_index("fault").join(theirs.add_prefix("development_"))
    return both.loc[
        [name for name in faults.PLANTS if name in both.index]
    ].reset_index()


def measured(out, name):
    return pd.read_csv(out / f"{name}.csv", comment="#")


def outcomes():
    """The first digits of the SHA-256 of what rules name in the recorded cases.

    It follows what the rules do, not how they are written.
    """
    found, _ = limits.as_they_are(pd.read_csv(RECORDED, comment="#"))
    text = "\n".join(" ".join(one.found) for one in found)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


if __name__ == "__main__":
    main()
