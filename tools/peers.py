"""Ours beside the code that papers have released: `make peers PEERS=folder`.

The folder holds checkouts, each by its repository's name; see `CHECKOUTS`. What is not
there is named, and not compared. google-research/multinerf needs the package gin-config
beside our environment, NeRF++ and BARF need PyTorch.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

# {folder: the variable that tests find it by}
CHECKOUTS = {
    "multinerf": "ALIGNERF_MULTINERF",
    "mipnerf": "ALIGNERF_MIPNERF",
    "nerfplusplus": "ALIGNERF_NERFPLUSPLUS",
    "bundle-adjusting-NeRF": "ALIGNERF_BARF",
}
TESTS = (
    "tests/alignerf/mipnerf360/test_multinerf.py",
    "tests/alignerf/mipnerf360/test_multinerf_model.py",
    "tests/alignerf/systems/test_official.py",
)


def main(argv=None):
    parser = argparse.ArgumentParser(prog="make peers", description=__doc__)
    parser.add_argument("folder", type=Path, help="of the checkouts")
    folder = parser.parse_args(argv).folder.expanduser().resolve()
    there = checkouts_in(folder)
    if not there:
        names = ", ".join(CHECKOUTS)
        sys.exit(f"error: PEERS: {folder}: no checkout of {names} in it")
    for name in CHECKOUTS:
        print(f"{name}: {'compared' if name in there else 'not there'}", flush=True)
    environment = os.environ | {CHECKOUTS[name]: str(there[name]) for name in there}
    # Compiled as users have it: as fast tests compile, some differences are larger.
    environment["ALIGNERF_OPTIMISED"] = "1"
    command = [sys.executable, "-m", "pytest", "-n0", "-q", *TESTS]
    sys.exit(subprocess.run(command, env=environment).returncode)


def checkouts_in(folder):
    """{name: its folder} of the checkouts that are there."""
    paths = {name: folder / name for name in CHECKOUTS}
    return {name: path for name, path in paths.items() if path.is_dir()}


if __name__ == "__main__":
    main()
