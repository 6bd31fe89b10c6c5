"""Lines that stay, and beneath them one that changes: a bar, where there is a terminal.

Elsewhere the changing line is printed now and then, as logs can have it.
"""

import os
import shutil
import sys
import time

BAR = 24
# Seconds between changes of the bar, and between such lines in a log.
EVERY_S, LOG_EVERY_S = 1.0, 30.0
CLEAR = "\r\x1b[2K"


class Screen:
    """Writes to standard output, or to another stream."""

    def __init__(self, stream=None):
        self.stream = stream or sys.stdout
        # An editor's shell knows no control sequences.
        dumb = os.environ.get("TERM") == "dumb"
        self.live = self.stream.isatty() and not dumb
        self.every_s = EVERY_S if self.live else LOG_EVERY_S
        self.shown_s = time.monotonic()
        # Removes what stands in the last line, such as the bar.
        self.clear = CLEAR if self.live else ""

    def line(self, text=""):
        """A line that stays."""
        self.write(f"{self.clear}{text}\n")

    def due(self):
        """Whether it is time for another state."""
        return time.monotonic() - self.shown_s >= self.every_s

    def state(self, share, text):
        """Show how far a run is; share: of it that is done, 0 to 1."""
        self.shown_s = time.monotonic()
        if not self.live:
            self.line(f"  ... {text}")
            return
        done = round(BAR * min(max(share, 0.0), 1.0))
        columns = shutil.get_terminal_size().columns
        whole = f"[{'#' * done}{'.' * (BAR - done)}] {text}"
        self.write(self.clear + whole[: columns - 1])

    def write(self, text):
        try:
            self.stream.write(text)
        except UnicodeEncodeError:
            # A file's name in a terminal that has not its letters.
            self.stream.write(text.encode("ascii", "backslashreplace").decode())
        self.stream.flush()

    def close(self):
        self.write(self.clear)


def clock(seconds):
    """'0:05', '12:30', '1:02:03'."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours}:{minutes:02d}:{seconds:02d}"
    return f"{minutes}:{seconds:02d}"
