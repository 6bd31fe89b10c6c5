"""The toys as another package has them: installed, with entry points."""

import pathlib

ROOT = pathlib.Path(__file__).resolve().parents[2]
POINTS = {
    "methods": "goes_on = tests.extension.toy_method:METHOD\n"
    "trimmed = tests.extension.toy_loss:METHOD",
    "test_sets": "blurred = tests.extension.toy_test_set:SET",
    "systems": "one_look = tests.extension.toy_system:SYSTEM",
    "estimators": "shift = tests.extension.toy_estimator:ESTIMATOR",
}


def install(folder):
    """Write the package's metadata into a folder, which is to be on Python's path."""
    info = folder / "toys-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toys\nVersion: 1.0\n")
    groups = (f"[alignerf.{group}]\n{point}\n" for group, point in POINTS.items())
    (info / "entry_points.txt").write_text("\n".join(groups))
    return folder
