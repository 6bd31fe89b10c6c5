"""How a command fails: one plain line that names the fault, and no traceback."""

import logging
import os
import sys

log = logging.getLogger("alignerf")


def run(main):
    """Call main(); where it fails on bad input, end the process with status 1."""
    if code := exit_code(main):
        sys.exit(code)


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
        if os.environ.get("ALIGNERF_DEBUG"):
            raise
        message = " ".join(str(error).split()) or type(error).__name__
        print(f"error: {message}", file=sys.stderr)
        return 1
    return 0


def fill_defaults(config, defaults, *, name="config"):
    """Nested dict `config` over `defaults`; a key that no default has is refused.

    A default that is a dict is filled recursively; other values are checked to be
    of their default's type (None accepts any, an int passes for a float).
    """
    unknown = sorted(set(config) - set(defaults))
    if unknown:
        raise ValueError(f"{name}: unknown key {unknown[0]!r}")
    filled = dict(defaults)
    for key, value in config.items():
        default = defaults[key]
        if isinstance(default, dict) and isinstance(value, dict):
            value = fill_defaults(value, default, name=f"{name}.{key}")
        elif default is not None and not _same_type(value, default):
            expected = type(default).__name__
            raise ValueError(f"{name}: {key} must be of type {expected}, not {value!r}")
        filled[key] = value
    return filled


def check_least(config, least, *, name=""):
    """ValueError for a value of `config` below what `least` {key: number} asks."""
    for key, bound in least.items():
        if not config[key] >= bound:
            raise ValueError(
                f"{name}{key}: must be at least {bound}, not {config[key]}"
            )


def _same_type(value, default):
    if isinstance(value, bool) or isinstance(default, bool):
        return isinstance(value, bool) and isinstance(default, bool)
    accepted = (int, float) if isinstance(default, float) else type(default)
    return isinstance(value, accepted)


def some_names(names, *, at_most=3):
    """'a, b, c and 4 more': names enough to look for, not a page of them."""
    shown = ", ".join(names[:at_most])
    rest = len(names) - at_most
    return f"{shown} and {rest} more" if rest > 0 else shown
