"""The verdicts of captures that were trained at several sizes, as a table.

    snakemake --cores N --configfile workflow/config/evidence/sizes.yaml
    python -m tools.bench.sizes workflow/config/evidence/sizes.yaml --out crops.csv

Scenes are called CAPTURE_WIDTH, and CAPTURE_WIDTH_off where their poses are wrong. A
scene without a verdict has no row.
"""

import argparse
import math
import re
from pathlib import Path

import pandas as pd

from alignerf.causes import base, shift
from alignerf.io import json_files, yaml_files

SCENE = re.compile(r"(?P<capture>[a-z]+)_(?P<width>\d+)(?P<off>_off)?\Z")
MANIFEST = {"evidence": dict, "state": str}
NAMES = {"castle": "castle_P30"}
CALLED = {"unclear": "cannot be told"}
POSES = {
    ("fox", False): "COLMAP's, given",
    ("fox", True): "off by 2 px",
    ("chair", False): "COLMAP's",
    ("chair", True): "the phone's own",
    ("flower", False): "LLFF's",
    ("castle", False): "surveyed",
    ("castle", True): "surveyed, off by 6 px",
    ("courtyard", False): "true",
    ("courtyard", True): "true, off by 3 px",
}


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config", type=Path)
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(argv)
    rows = []
    for scene in yaml_files.read(args.config)["scenes"]:
        path = args.results / scene / "verdict.json"
        if path.exists():
            rows.append(row_of(scene, json_files.read(path, MANIFEST)))
    rows.sort(key=lambda row: row["known"] == "wrong")
    pd.DataFrame(rows).to_csv(args.out, index=False, float_format="%.2f")


def row_of(scene, verdict):
    """What is known of a capture's poses, and what its verdict says."""
    name = SCENE.match(scene)
    is_off = bool(name["off"])
    known = evidence_of(verdict["evidence"])
    of_crops, width_px = known.crops, known.photo_width_px
    said = shift.of_crops_say(known)
    return {
        "capture": NAMES.get(name["capture"], name["capture"]),
        "poses": POSES[name["capture"], is_off],
        "known": "wrong" if is_off else "right",
        "trained_px": int(name["width"]),
        "width_px": round(width_px),
        "flow_px": of_crops.flow_px,
        "flow_low_px": of_crops.low_px,
        "flow_high_px": of_crops.high_px,
        "flow_1600_px": of_crops.flow_px * shift.USUAL_WIDTH_PX / width_px,
        "flow_test_px": of_crops.flow_test_px,
        "epochs": of_crops.epochs,
        "crops": said if shift.known_crops(known) else f"tell nothing ({said})",
        "verdict": CALLED.get(verdict["state"], verdict["state"]),
    }


def evidence_of(stored):
    """`base.Evidence` of a verdict's file, where null stands for NaN."""

    def known(values):
        return {k: math.nan if v is None else v for k, v in values.items()}

    crops_of = base.Crops(**known(stored["crops"]))
    more = {"crops": crops_of, "judged": None}
    return base.Evidence(**known(stored) | more)


if __name__ == "__main__":
    main()
