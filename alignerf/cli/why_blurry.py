"""One command for all of them, where this project is installed: `why-blurry photos`.

Beside `make`, it runs the same modules.
"""

import importlib
import os
import sys

import alignerf
from alignerf.io import faults, provenance
from alignerf.io.environment import switches

HELP = """\
why-blurry: why a NeRF or a Gaussian splat is blurry, and what to do first.

    why-blurry demo                the embedded scene, from nothing to its verdict
    why-blurry photos my_photos    your own photos or videos, to a verdict and a page
    why-blurry poses my_scan       check and adjust cameras that came with photos
    why-blurry judge --photos photos --renders renders --cameras sparse/0
                                   what another program trained
    why-blurry export my_photos    photos, cameras and points for other programs
    why-blurry show                the finished tables, and the verdict again

Each has --help; --version says which this is. Results lie in results/ of the folder
that it is called in. VERBOSE=1 before it shows all that Snakemake prints.
"""
# {word: the module that it runs}.
COMMANDS = {
    "demo": "alignerf.cli.demo",
    "photos": "alignerf.cli.__main__",
    "poses": "alignerf.cli.poses",
    "judge": "alignerf.cli.judge",
    "export": "alignerf.cli.export",
    "show": "alignerf.show",
}


def main(words=None):
    """Run a command with the words behind it, as `python -m` would."""
    faults.run(lambda: run(*(sys.argv[1:] if words is None else words)))


def run(command="--help", *words):
    if command in ("-h", "--help"):
        print(HELP.strip())
        return
    if command == "--version":
        print(f"why-blurry {alignerf.__version__}")
        return
    if command not in COMMANDS:
        known = ", ".join(COMMANDS)
        raise ValueError(f"why-blurry {command}: no such command; there are {known}")
    switches.settle()
    os.environ[provenance.TYPED] = "why-blurry"
    sys.argv = [f"why-blurry {command}", *words]
    importlib.import_module(COMMANDS[command]).main(list(words))


if __name__ == "__main__":
    main()
