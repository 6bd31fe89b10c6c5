"""How the benchmarks time: interleaved arms, medians, pairs; and where figures are of.

Notation: a rate is work / seconds; a ratio is how many times faster ours is than the
peer, one for each pair of neighbours in time: a slow minute of the machine hits both.
"""

import csv
import datetime
import hashlib
import io
import math
import os
import statistics
import time
from pathlib import Path

import jax

from alignerf.io import machine, provenance

# Columns of where figures are of, and of a row of rates.
ORIGIN = ("device", "cores", "jax", "commit", "lock")
ARMS, SPREAD = ("ours", "multinerf"), ("", "_low", "_high")
RATES = ["what", *(f"{arm}{part}_rays_per_s" for arm in ARMS for part in SPREAD)]
RATES += [*(f"ratio{part}" for part in SPREAD), "note", *ORIGIN]


def spread(values):
    """[median, least, largest] of one value or more."""
    values = [float(value) for value in values]
    return [statistics.median(values), min(values), max(values)]


def seconds(call, count=1):
    """Of a call, of `count` in a row, until all that they return has been computed."""
    start = time.perf_counter()
    for _ in range(count):
        found = call()
    jax.block_until_ready(found)
    return (time.perf_counter() - start) / count


def interleave(arms, repeats, *, least_s=0.0):
    """Seconds {name: [repeats]} of the arms {name: call}: A B A B, compiled before.

    least_s: of a turn, which has so many calls: a device works while others are queued.
    """
    times, counts = {name: [] for name in arms}, {}
    for name, call in arms.items():
        once = [seconds(call) for _ in range(2 if least_s else 1)]
        counts[name] = max(1, math.ceil(least_s / once[-1]))
    for _ in range(repeats):
        for name, call in arms.items():
            times[name].append(seconds(call, counts[name]))
    return times


def rates(what, times, work, *, note=""):
    """A row of RATES from the seconds of `ours` and, if there is one, `multinerf`."""
    row = {"what": what, "note": note} | origin()
    for name, own in times.items():
        row |= named(f"{name}{{}}_rays_per_s", [work / s for s in own])
    if len(times) > 1:
        pairs = zip(*(times[name] for name in ARMS), strict=True)
        row |= named("ratio{}", [theirs / ours for ours, theirs in pairs])
    return row


def named(column, values):
    """{column: value} of the spread of values."""
    return dict(zip(map(column.format, SPREAD), spread(values), strict=True))


def origin():
    """Device and code of this process, by the columns of ORIGIN."""
    facts = provenance.facts()
    device = jax.devices()[0]
    known = device.device_kind if device.platform != "cpu" else machine.processor()
    values = known, machine.cores(), jax.__version__, facts["commit"], facts["lock"]
    return dict(zip(ORIGIN, values, strict=True))


def append(path, columns, row):
    """Add a row {column: value} to a CSV: in one write, which is then on the disk.

    So a kill loses no row. ValueError where the file has other columns.
    """
    text, path = io.StringIO(newline=""), Path(path)
    lines = csv.DictWriter(text, columns, lineterminator="\n")
    if not path.exists():
        lines.writeheader()
    elif (has := path.read_text().partition("\n")[0]) != ",".join(columns):
        raise ValueError(f"{path}: columns {has:.80}, not {','.join(columns):.80}")
    lines.writerow(row)
    with open(path, "ab", buffering=0) as file:
        file.write(text.getvalue().encode())
        os.fsync(file.fileno())


def head(command, machine):
    """The five lines of a measured CSV."""
    lines = {
        "commit": provenance.commit(),
        "lock": provenance.lock(),
        "machine": machine,
        "command": command,
        "measured": datetime.date.today(),
    }
    return "".join(f"# {key}: {value}\n" for key, value in lines.items())


def digest(*folders):
    """The first digits of the SHA-256 of code and data in folders of the project."""
    found = hashlib.sha256()
    for folder in folders:
        for path in sorted((provenance.ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".yaml"):
                found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()[:12]
