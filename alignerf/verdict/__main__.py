"""The verdict on a scene: `python -m alignerf.verdict`.

Writes verdict.json (what is wrong, how sure that is, what to do, what that brings and
costs) and views.csv (every photo, and why it stands out); prints the verdict.
"""

import argparse
import json
from functools import partial

import pandas as pd

from alignerf.files import atomic, faults, json_files
from alignerf.metrics import pairs
from alignerf.scenes import prepared
from alignerf.verdict import (
    advice,
    causes,
    corrections,
    evidence,
    judged,
    remedies,
    report,
    views,
    words,
)


def main(argv=None):
    args = parse(argv)
    loaded = prepared.load(args.scene)
    poses = json_files.read(f"{args.scene}/poses.json", evidence.POSES)
    timing = json_files.read(f"{args.base}/timing.json", evidence.TIMING)
    look = None
    if timing["rays_seen"] is None:
        # Another program's: its black borders may be all of what a photo shows.
        told = poses.get("judged")
        look = partial(pairs.look, whole=bool(told and not told.get("transparent")))
    seen = evidence.read_views(loaded, args.base, ("train", "test"), look)
    known = evidence.gather(
        loaded,
        seen,
        evidence.read_pattern(loaded, args.base),
        poses=poses,
        timing=timing,
        overfit=args.overfit,
        windows=(args.windows, args.windows_corrected),
        of_judged=judged.read(poses, args.before),
    )
    findings = causes.find(known)
    gains = []
    if args.misalignment:
        gains = remedies.of_table(
            args.misalignment,
            json.loads(args.aligned),
            corrections.judged(args.scene, json.loads(args.corrected)),
        )
    told = report.of(known, findings, gains, seen.rows)
    lines = report.terminal(told)
    content = {
        "verdict": lines,
        "state": words.state(known, findings),
        **told._asdict(),
        "findings": [finding._asdict() for finding in findings],
        "gains": [
            gain._asdict() | {"pays": advice.pays(known, gain)} for gain in gains
        ],
        "evidence": known._asdict()
        | {"windows": known.windows and known.windows._asdict()}
        | {"judged": known.judged and known.judged._asdict()}
        | {"matches": known.matches and known.matches._asdict()}
        | {"pairs": known.pairs._asdict() | {"stops": known.pairs.stops}},
        "stands_out": {v.view: v.stands_out for v in seen.rows if v.stands_out},
    }
    table = pd.DataFrame(seen.rows, columns=views.COLUMNS)
    with (
        atomic.replace_file(args.out) as path,
        atomic.replace_file(args.views) as views_path,
    ):
        # JSON has no NaN.
        path.write_text(json.dumps(plain(content), indent=1) + "\n")
        table.to_csv(views_path, index=False, float_format="%.6g")
    print("\n".join(map(faults.one_line, lines)))


def plain(value):
    """Null for what is not a finite number."""
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [plain(entry) for entry in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.verdict", description=__doc__)
    parser.add_argument("--scene", required=True, help="results/SCENE")
    parser.add_argument("--base", required=True, help="the reference's round 0")
    parser.add_argument("--overfit", help="the test set's overfit.csv")
    parser.add_argument("--misalignment", help="the scene's misalignment.csv")
    parser.add_argument(
        "--aligned",
        default="{}",
        help="JSON: {method: timing.json} of what has aligned itself",
    )
    parser.add_argument(
        "--corrected",
        default="{}",
        help="JSON: {method: cameras.npz} of trainings that have moved cameras",
    )
    parser.add_argument(
        "--windows", help="a training's folder, of windows at the photos' own size"
    )
    parser.add_argument(
        "--windows-corrected", help="the same with cameras that a method has put right"
    )
    parser.add_argument("--before", help="verdict.json of renders judged before")
    parser.add_argument("--out", required=True, help="verdict.json, written")
    parser.add_argument("--views", required=True, help="views.csv, written")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
