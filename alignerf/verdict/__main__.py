"""The verdict on a scene: `python -m alignerf.verdict`.

Writes verdict.json (what is wrong, how sure that is, what to do, what that brings and
costs) and views.csv (every photo, and why it stands out); prints the verdict.
"""

import argparse
import json
import math
from functools import partial
from pathlib import Path

import pandas as pd

from alignerf import causes
from alignerf.causes import remedies
from alignerf.files import atomic, faults, json_files
from alignerf.metrics import pairs
from alignerf.scenes import prepared
from alignerf.verdict import evidence, gains, report, views


def main(argv=None):
    args = parse(argv)
    loaded = prepared.load(args.scene)
    poses = json_files.read(args.scene / "poses.json", evidence.POSES)
    timing = json_files.read(args.base / "timing.json", evidence.TIMING)
    look = None
    if timing["rays_seen"] is None:
        # Another program's: its black borders may be all of what a photo shows.
        told = poses.get("judged")
        look = partial(pairs.look, whole=bool(told and not told.get("transparent")))
    seen = evidence.read_views(loaded, args.base, prepared.SPLITS, look)
    known = evidence.gather(
        loaded,
        seen,
        evidence.read_pattern(loaded, args.base),
        poses=poses,
        timing=timing,
        overfit=args.overfit,
        windows=(args.windows, args.windows_corrected),
        before=args.before,
    )
    brought = []
    if args.misalignment:
        judged = gains.judgements(args.scene, args.corrected)
        brought = gains.of_table(args.misalignment, args.aligned, judged)
    content = content_of(known, brought, seen.rows)
    table = pd.DataFrame(seen.rows, columns=views.COLUMNS)
    with (
        atomic.replace_file(args.out) as path,
        atomic.replace_file(args.views) as views_path,
    ):
        path.write_text(json.dumps(plain(content), indent=1) + "\n")
        table.to_csv(views_path, index=False, float_format="%.6g")
    print("\n".join(map(faults.one_line, content["verdict"])))


def content_of(known, brought, rows):
    """What verdict.json holds. brought: `remedies.Gain`s; rows: `views.View`s."""
    findings = causes.find(known)
    told = report.of(known, findings, brought, rows)
    return {
        "verdict": report.terminal(told),
        **told,
        "findings": [f._asdict() | {"cause": f.cause.name} for f in findings],
        "gains": [g._asdict() | {"pays": remedies.pays(known, g)} for g in brought],
        "evidence": {
            key: value._asdict() if hasattr(value, "_asdict") else value
            for key, value in known._asdict().items()
        }
        | {"pairs": known.pairs._asdict() | {"stops": known.pairs.stops}},
        "stands_out": {row.view: row.stands_out for row in rows if row.stands_out},
    }


def plain(value):
    """Null for what is not a finite number: JSON has no NaN."""
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.verdict", description=__doc__)
    add = parser.add_argument
    add("--scene", type=Path, required=True, help="results/SCENE")
    add("--base", type=Path, required=True, help="the reference's round 0")
    add("--overfit", help="the test set's overfit.csv")
    add("--misalignment", help="the scene's misalignment.csv")
    add(
        "--aligned",
        type=json.loads,
        default={},
        help="JSON: {method: timing.json} of what has aligned itself",
    )
    add(
        "--corrected",
        type=json.loads,
        default={},
        help="JSON: {method: cameras.npz} of trainings that have moved cameras",
    )
    add("--windows", help="a training's folder, of windows at the photos' own size")
    add("--windows-corrected", help="the same with cameras that were put right")
    add("--before", help="verdict.json of renders judged before")
    add("--out", required=True, help="verdict.json, written")
    add("--views", required=True, help="views.csv, written")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
