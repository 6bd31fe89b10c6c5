"""Ctrl-C while a command is imported, which takes seconds: one line, as afterwards.

An exception in the middle of an import may become any other, and a page of traceback.
So a command ends at once until its `main` is called (`io.faults.exit_code`), and from
then on a KeyboardInterrupt lets it tidy up.
"""

import contextlib
import os
import signal

CODE, SAID = 130, "stopped; nothing half-made is left"


def leave(*_):
    """End the process with one line, whatever it is about."""
    os.write(2, f"{SAID}\n".encode())
    os._exit(CODE)


def begin():
    """Let Ctrl-C end the process at once, where nobody wants something else of it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, leave)


@contextlib.contextmanager
def raised(handler=signal.default_int_handler, otherwise=leave):
    """Let Ctrl-C raise KeyboardInterrupt where it would end the process at once."""
    if is_changed := signal.getsignal(signal.SIGINT) is otherwise:
        signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        if is_changed:
            signal.signal(signal.SIGINT, otherwise)


def importing():
    """Let it end the process at once where it would raise KeyboardInterrupt."""
    return raised(leave, signal.default_int_handler)
