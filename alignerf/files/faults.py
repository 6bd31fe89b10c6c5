"""How a command fails: one plain line that names the fault, and no traceback."""

import io
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
    take_any_letter(sys.stdout)
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


def take_any_letter(stream):
    """Let a terminal that has ASCII alone show other letters escaped, not end a run."""
    # One that a test or a notebook has put there may be of another kind.
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors="backslashreplace")


def check_regular(path):
    """ValueError for a pipe or a device: who opens one may wait for ever."""
    kind = os.stat(path).st_mode
    if not (stat.S_ISREG(kind) or stat.S_ISDIR(kind)):
        raise ValueError(f"{path}: not a file")


def some_names(names, *, at_most=3):
    """'a, b, c and 4 more': names enough to look for, not a page of them."""
    few = ", ".join(map(name_of, names[:at_most]))
    rest = len(names) - at_most
    return f"{few} and {rest} more" if rest > 0 else few


def name_of(text, most=200):
    """A name as it is written in a message, in at most `most` characters.

    One that cannot be printed stands in quotes, escaped.
    """
    return cut(text if text.isprintable() else ascii(text), most)


def shown(value, most=60) -> str:
    """A value of a file as Python writes it, in at most `most` characters.

    What cannot be printed is escaped. For messages: a value may be of any length, and
    may hold what a terminal obeys.
    """
    if isinstance(value, str):
        # A text of a megabyte need not be escaped whole.
        value = value[:most]
    try:
        text = repr(value)
    # Of whole numbers of 5000 digits, and of lists in one another.
    except (ValueError, RecursionError):
        text = f"a {type(value).__name__}"
    return name_of(text, most)


def cut(text, most):
    """A text of at most `most` characters; of a longer one the end is left out."""
    return text if len(text) <= most else text[: most - 3] + "..."
