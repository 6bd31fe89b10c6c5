"""How a command fails: one plain line that names the fault, and no traceback."""

import argparse
import io
import logging
import math
import os
import pathlib
import reprlib
import stat
import sys

from alignerf.io.environment import interrupts

log = logging.getLogger("alignerf")

# Of a line that is printed. Of a longer one both ends are kept: files and keys are
# named at the beginning, what to do at the end.
MAX_CHARACTERS, HEAD = 1000, 700
# Of a text: a transforms.json of 100,000 frames has no more.
MAX_BYTES = 2**26


class Named(ValueError):
    """A fault that names its file already."""


def stated(text):
    """A text, as argparse's `type`. An empty one is refused: it stands for a path that
    was to be there, and would be taken for none.
    """
    if not text:
        raise argparse.ArgumentTypeError("nothing stands there")
    return text


FLAG, SEVERAL = {"action": "store_true"}, {"nargs": "+"}
THREADS = "at most (default: every core)", int
GPUS = "accelerators at most, where there are more", 1


def arguments(argv, description, options):
    """The values of a command's options, which argv gives as `--name value`.

    options: {name: help}, or (help, the type, the default, or what `add_argument` is to
    know of it). An option `[name]` may be left out; it is None without a default.
    """
    module = sys.modules["__main__"].__spec__
    parser = argparse.ArgumentParser(
        prog=module and module.name.removesuffix(".__main__"),
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    for name, told in options.items():
        text, what = told if isinstance(told, tuple) else (told, stated)
        if callable(what):
            what = {"type": what}
        elif not isinstance(what, dict):
            what = {"type": type(what), "default": what}
        needed = not name.startswith("[")
        parser.add_argument(f"--{name.strip('[]')}", required=needed, help=text, **what)
    return parser.parse_args(argv)


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
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(OneLine())
    logging.basicConfig(handlers=[handler])
    log.setLevel(logging.INFO)
    take_any_letter(sys.stdout)
    try:
        with interrupts.raised():
            main(*arguments, **options)
    except (ValueError, OSError) as error:
        say(error)
        return 1
    except KeyboardInterrupt:
        print(interrupts.SAID, file=sys.stderr)
        return interrupts.CODE
    except Exception as error:
        if (name := platform_missing()) is None:
            raise
        reason = f"{name}={os.environ[name]}: JAX cannot start on it here"
        say(ValueError(f"environment: {reason}, unset it: {error!s:.300}"))
        return 1
    return 0


def platform_missing(modules=sys.modules):
    """The variable that names a platform on which JAX does not start, if one does.

    This module does without JAX: it asks the one that a command has imported.
    """
    names = ("JAX_PLATFORMS", "JAX_PLATFORM_NAME")
    if "jax" not in modules or not (given := [n for n in names if os.environ.get(n)]):
        return None
    try:
        modules["jax"].devices()
    # An AssertionError, or a RuntimeError, which says what it was asked for.
    except Exception as error:
        text = str(error)
        said = [name for name in given if os.environ[name] in text]
        # It says that first, and then what there is.
        return min(said or given[:1], key=lambda name: text.find(os.environ[name]))
    return None


def say(error):
    """Print a fault in one line; for developers, who ask for it, raise it again."""
    if os.environ.get("ALIGNERF_DEBUG"):
        raise error
    message = " ".join(str(error).split()) or type(error).__name__
    print(f"error: {one_line(message)}", file=sys.stderr)


# Before a message that a user should see also where all others go to a file.
WARNING = "warning: "


class OneLine(logging.Formatter):
    """Each message as one line, whatever the names in it hold; a warning says so."""

    def formatMessage(self, record):
        head = WARNING if record.levelno == logging.WARNING else ""
        return one_line(head + record.message)


def one_line(text):
    """A text that a terminal shows as one line, of at most MAX_CHARACTERS.

    What does not print is escaped: names of files may hold ends of lines, codes of
    terminals and letters that turn the direction of writing.
    """
    if text.isprintable() and len(text) <= MAX_CHARACTERS:
        return text
    # Escaped, a character is up to ten.
    for _ in range(2):
        if len(text) > MAX_CHARACTERS:
            tail = MAX_CHARACTERS - HEAD - len(" [...] ")
            text = f"{text[:HEAD]} [...] {text[-tail:]}"
        text = "".join(c if c.isprintable() else escaped(c) for c in text)
    return text


def escaped(character):
    """A character that does not print, as Python writes it."""
    return character.encode("unicode_escape").decode("ascii")


def take_any_letter(stream):
    """Let a terminal that has ASCII alone show other letters escaped, not end a run."""
    # One that a test or a notebook has put there may be of another kind.
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors="backslashreplace")


def resolved(path):
    """The path that links lead to. Of links in a circle as far as they lead.

    pathlib's raises RuntimeError for these; who opens them gets an OSError that names
    the file.
    """
    return pathlib.Path(os.path.realpath(path))


def check_regular(path, most=math.inf):
    """ValueError for a pipe or a device: who opens one may wait for ever.

    And for a file that is missing, or of more than so many bytes.
    """
    try:
        found = os.stat(path)
    except FileNotFoundError:
        raise Named(f"{path}: not found") from None
    if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
        raise Named(f"{path}: not a file")
    if found.st_size > most:
        raise Named(f"{path}: {found.st_size:,} bytes, over {most:,}")


def opened(path, most=math.inf):
    """A file open for reading its bytes, after `check_regular`."""
    check_regular(path, most)
    return open(path, "rb")


def content(path, most=math.inf):
    """The bytes of a file, after `check_regular`."""
    with opened(path, most) as file:
        return file.read()


def text(path, most=MAX_BYTES):
    """The UTF-8 text of a file, after `check_regular`; without a byte order mark."""
    try:
        with io.TextIOWrapper(opened(path, most), encoding="utf-8-sig") as file:
            return file.read()
    except UnicodeDecodeError as error:
        raise Named(f"{path}: not UTF-8: {error}") from None


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


# A value as Python writes it, but for what no message has room for. It is bounded while
# it is written: lists in lists may hold a billion values.
SHORT = reprlib.Repr()
SHORT.maxlevel, SHORT.maxlist, SHORT.maxdict, SHORT.maxstring = 3, 20, 20, 300
SHORT.maxlong, SHORT.maxother = 60, 300


def shown(value, most=60) -> str:
    """A value of a file as Python writes it, in at most `most` characters.

    What cannot be printed is escaped. For messages: a value may be of any length, and
    may hold what a terminal obeys.
    """
    if isinstance(value, str):
        # Its beginning tells more than its end.
        value = value[:most]
    try:
        text = SHORT.repr(value)
    # Of whole numbers of 5000 digits.
    except ValueError:
        text = f"{type(value).__name__} of too many digits"
    return name_of(text, most)


def cut(text, most):
    """A text of at most `most` characters; of a longer one the end is left out."""
    return text if len(text) <= most else text[: most - 3] + "..."
