"""One command for all of them, where this project is installed: `why-blurry photos`.

Beside `make`, it runs the same modules.
"""

import importlib
import os
import sys

from alignerf.io import faults, provenance
from alignerf.io.environment import interrupts, switches

HELP = """\
Why a NeRF or a splat is blurry, and what to fix first.

    why-blurry demo                diagnose the demo scene
    why-blurry photos my_photos    train on your photos or video, and diagnose that
    why-blurry poses my_scan       check the cameras that came with photos
    why-blurry judge --photos images --renders renders --cameras sparse/0
                                   diagnose renders, or a splat, of another program
    why-blurry export my_photos    write photos, cameras and points for other programs
    why-blurry show                print the tables and verdicts of finished runs
    why-blurry clean               delete the results of this program, nothing else

`why-blurry photos --help` lists the options of photos. Results go into results/ of the
current folder. VERBOSE=1 in the environment shows all output.
`why-blurry --version` prints the version.
"""
INSTALL = "Type `. .venv/bin/activate` first, or use make, which installs all packages"
# {word: the module that it runs}.
COMMANDS = {
    "demo": "alignerf.cli.demo",
    "photos": "alignerf.cli.__main__",
    "poses": "alignerf.cli.poses",
    "judge": "alignerf.cli.judge",
    "export": "alignerf.cli.export",
    "show": "alignerf.show",
    "clean": "alignerf.cli.clean",
}


def main(words=None):
    """Run a command with the words behind it, as `python -m` would."""
    faults.run(lambda: run(*(sys.argv[1:] if words is None else words)))


def run(command="--help", *words):
    if command in ("-h", "--help"):
        print(HELP.strip())
        return
    if command == "--version":
        print(f"why-blurry {provenance.VERSION}")
        return
    if command not in COMMANDS:
        known = ", ".join(COMMANDS)
        raise ValueError(f"why-blurry {command}: no such command; there are {known}")
    switches.settle()
    os.environ[provenance.TYPED] = "why-blurry"
    sys.argv = [f"why-blurry {command}", *words]
    try:
        with interrupts.importing():
            module = importlib.import_module(COMMANDS[command])
    except ModuleNotFoundError as error:
        raise ValueError(f"{error.name} is not installed here. {INSTALL}") from None
    module.main(list(words))


if __name__ == "__main__":
    main()
