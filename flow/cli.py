"""What the commands share: a fault of the input is one line, not a traceback."""

import sys


def exit_code(main, *arguments, **options) -> int:
    """Call main; 0, or 1 with `error: ...` on stderr for ValueError and OSError."""
    try:
        main(*arguments, **options)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
