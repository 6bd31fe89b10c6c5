"""What the commands share: how often bars move, and one line for bad input."""

import sys

# Seconds between updates of a bar; a log needs few lines.
PROGRESS_S = 0.1 if sys.stderr.isatty() else 10.0


def exit_code(main, *arguments, **options) -> int:
    """Call main; 0, or 1 with `error: ...` on stderr for ValueError and OSError."""
    try:
        main(*arguments, **options)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
