"""What Snakemake does, as lines of JSON: for whoever shows a run in words of its own.

Snakemake finds this plugin where its folder is on the search path, and uses it where
`--logger alignerf-events` asks for it. It writes to the end of the file that
ALIGNERF_EVENTS names. It changes nothing of what Snakemake itself prints.
"""

import json
import os
from pathlib import Path

from snakemake_interface_logger_plugins.base import LogHandlerBase

FILE = "ALIGNERF_EVENTS"
FOLDER = Path(__file__).resolve().parents[1]
# What is told of a job.
OF_JOB = ("jobid", "rule_name", "done", "total")


class LogHandler(LogHandlerBase):
    """Writes each event."""

    writes_to_stream = False
    writes_to_file = False
    has_filter = True
    has_formatter = True
    needs_rulegraph = False

    def __post_init__(self):
        self.file = open(os.environ.pop(FILE), "ab", buffering=0)  # noqa: SIM115
        # Found, it is of no use to jobs, nor to other programs that they start.
        paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
        rest = [path for path in paths if path and Path(path).resolve() != FOLDER]
        os.environ["PYTHONPATH"] = os.pathsep.join(rest)

    def emit(self, record):
        try:
            self.file.write(json.dumps(told(record)).encode() + b"\n")
        except (AttributeError, KeyError, TypeError, ValueError):
            # As where another version of Snakemake tells other things.
            self.handleError(record)


def told(record):
    """An event as JSON can have it. Keys that it does not have are left out."""
    given = vars(record)
    found = {"event": str(given.get("event") or "text")}
    found |= {key: given[key] for key in OF_JOB if key in given}
    if found["event"] == "job_finished":
        found["jobid"] = record.job_id
    elif found["event"] == "job_info":
        for key in ("output", "log"):
            found[key] = [str(path) for path in given.get(key) or ()]
        found["wildcards"] = {k: str(v) for k, v in record.wildcards.items()}
    elif found["event"] == "run_info":
        found["total"] = record.stats["total"]
    elif found["event"] in ("text", "error") and record.levelname == "ERROR":
        found |= {"event": "error", "text": record.getMessage()}
    return found
