"""What Snakemake does, as lines of JSON: for whoever shows a run in words of its own.

Snakemake finds this plugin where its folder is on the search path, and uses it where
`--logger alignerf-events` asks for it. It writes to the file descriptor that
ALIGNERF_EVENTS_FD names. It changes nothing of what Snakemake itself prints.
"""

import json
import logging
import os
from pathlib import Path

from snakemake_interface_logger_plugins.base import LogHandlerBase

FILE_DESCRIPTOR = "ALIGNERF_EVENTS_FD"
FOLDER = Path(__file__).resolve().parents[1]
# What is told of a job.
OF_JOB = ("jobid", "job_id", "rule_name", "jobs", "done", "total")


class LogHandler(LogHandlerBase):
    """Writes each event; a reader that is gone never fails a run."""

    writes_to_stream = False
    writes_to_file = False
    has_filter = True
    has_formatter = True
    needs_rulegraph = False

    def __post_init__(self):
        self.file_descriptor = int(os.environ.pop(FILE_DESCRIPTOR))
        # Found, it is of no use to jobs, nor to other programs that they start.
        paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
        rest = [path for path in paths if path and Path(path).resolve() != FOLDER]
        os.environ["PYTHONPATH"] = os.pathsep.join(rest)

    def emit(self, record):
        try:
            line = json.dumps(told(record)) + "\n"
            os.write(self.file_descriptor, line.encode())
        except OSError:
            # Nobody reads any more.
            pass
        except (AttributeError, KeyError, TypeError, ValueError):
            # As where another version of Snakemake tells other things.
            self.handleError(record)


def told(record):
    """An event as JSON can have it. Keys that it does not have are left out."""
    found = {"event": str(getattr(record, "event", None) or "text")}
    found |= {key: vars(record)[key] for key in OF_JOB if key in vars(record)}
    if found["event"] == "run_info":
        found["total"] = record.stats["total"]
    for key in ("output", "log"):
        if key in vars(record):
            found[key] = [str(path) for path in vars(record)[key] or ()]
    if "wildcards" in vars(record):
        found["wildcards"] = {k: str(v) for k, v in record.wildcards.items()}
    if found["event"] in ("text", "error") and record.levelno >= logging.WARNING:
        found["level"], found["text"] = record.levelname, record.getMessage()
    # Set by the Snakefile: the plans of which scenes tell the time that is left.
    if found["event"] == "run_info":
        found["scenes"] = os.environ.get("ALIGNERF_SCENES", "")
    return found
