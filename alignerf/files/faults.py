"""How a command fails: one plain line that names the fault, and no traceback."""

import logging
import os
import stat
import sys

log = logging.getLogger("alignerf")


def run(main):
    """Call main(); where it fails on bad input, end the process with status 1."""
    if code := exit_code(main):
        sys.exit(code)


def or_exit(function, *arguments):
    """function(*arguments); bad input ends the process with one line and status 1.

    For a Snakefile, which would end with a traceback of the workflow engine.
    """
    try:
        return function(*arguments)
    except (ValueError, OSError) as error:
        say(error)
        sys.exit(1)


def exit_code(main, *arguments, **options) -> int:
    """Call main with logging on; 0, or 1 with one line for a fault of the input.

    Pure modules raise ValueError for what a user can cause and the system raises
    OSError; both become `error: ...` on stderr. The traceback is for developers: set
    ALIGNERF_DEBUG=1.
    """
    logging.basicConfig(format="%(message)s", stream=sys.stderr)
    log.setLevel(logging.INFO)
    try:
        main(*arguments, **options)
    except (ValueError, OSError) as error:
        say(error)
        return 1
    return 0


def say(error):
    """Print a fault in one line; for developers, who ask for it, raise it again."""
    if os.environ.get("ALIGNERF_DEBUG"):
        raise error
    message = " ".join(str(error).split()) or type(error).__name__
    print(f"error: {message}", file=sys.stderr)


def check_regular(path):
    """ValueError for a pipe or a device: who opens one may wait for ever."""
    kind = os.stat(path).st_mode
    if not (stat.S_ISREG(kind) or stat.S_ISDIR(kind)):
        raise ValueError(f"{path}: not a file")


def some_names(names, *, at_most=3):
    """'a, b, c and 4 more': names enough to look for, not a page of them."""
    shown = ", ".join(names[:at_most])
    rest = len(names) - at_most
    return f"{shown} and {rest} more" if rest > 0 else shown
