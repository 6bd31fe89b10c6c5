"""The verdict on a scene: `python -m alignerf.verdict`.

Writes verdict.json (what is wrong, how sure that is, what to do, what that brings and
costs), views.csv (every photo, and why it stands out) and transients.npz (where photos
show what comes and goes, if that is named); prints the verdict.
"""

import json
import math
from pathlib import Path

import pandas as pd

from alignerf.cameras import transients
from alignerf.causes.shared import remedies
from alignerf.io import atomic, faults
from alignerf.metrics import image
from alignerf.tables import columns
from alignerf.verdict import evidence, gains, report, views

NETS = [name.removeprefix("lpips_") for name in columns.NETWORKS]
OPTIONS = {
    "scene": ("results/SCENE", Path),
    "base": ("the reference's round 0", Path),
    "out": "verdict.json, written",
    "views": "views.csv, written",
    "transients": "transients.npz, written",
    "[overfit]": "the test set's overfit.csv",
    "[misalignment]": "the scene's misalignment.csv",
    "[aligned]": ("JSON: {method: timing.json} of what has aligned itself", "{}"),
    "[corrected]": ("JSON: {method: cameras.npz} of moved cameras", "{}"),
    "[crops]": "a training's folder, of crops at the photos' own size",
    "[crops-corrected]": "the same with cameras that a method has corrected",
    "[before]": "verdict.json of renders judged before",
    **{f"[lpips-{net}]": "weights of this LPIPS, .npz" for net in NETS},
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    known, rows, shown = evidence.read_all(
        args.scene,
        args.base,
        overfit=args.overfit,
        crops=(args.crops, args.crops_corrected),
        before=args.before,
        learned=image.learned({net: getattr(args, f"lpips_{net}") for net in NETS}),
    )
    if args.misalignment:
        judged = gains.judgements(args.scene, json.loads(args.corrected))
        timings = json.loads(args.aligned)
        brought = gains.of_table(args.misalignment, timings, judged)
        known = known._replace(tried=tuple(brought))
    content = content_of(known, rows)
    named = {one["cause"] for one in content["findings"]}
    table = pd.DataFrame(rows, columns=views.COLUMNS)
    with (
        atomic.replace_file(args.out) as path,
        atomic.replace_file(args.views) as views_path,
        atomic.replace_file(args.transients) as masks_path,
    ):
        path.write_text(json.dumps(plain(content), indent=1) + "\n")
        table.to_csv(views_path, index=False, float_format="%.6g")
        transients.write(masks_path, shown if "transients" in named else {})
    print("\n".join(map(faults.one_line, content["verdict"])))


def content_of(known, rows):
    """What verdict.json holds. known: `base.Evidence`; rows: `views.View`s."""
    told, numbers = report.of(known, rows), known._asdict()
    numbers["pairs"] = known.pairs._asdict() | {"stops": known.pairs.stops}
    brought = numbers.pop("tried")
    return {
        "verdict": report.terminal(told),
        **told,
        "gains": [g._asdict() | {"pays": remedies.pays(known, g)} for g in brought],
        "evidence": numbers,
        "stands_out": {row.view: row.stands_out for row in views.odd(rows)},
    }


def plain(value):
    """For JSON, which has no NaN: null for what is not a finite number."""
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


if __name__ == "__main__":
    faults.run(main)
