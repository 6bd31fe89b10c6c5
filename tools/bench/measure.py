"""How the benchmarks time: interleaved arms, medians, pairs; and where figures are of.

Notation: a rate is work / seconds; a ratio is how many times faster ours is than the
peer, one for each pair of neighbours in time: a slow minute of the machine hits both.
"""

import datetime
import hashlib
import statistics
import time

import jax

from alignerf.io import provenance


def spread(values):
    """[median, least, largest] of one value or more."""
    values = [float(value) for value in values]
    return [statistics.median(values), min(values), max(values)]


def seconds(call):
    """Of one call, until all that it returns has been computed."""
    start = time.perf_counter()
    jax.block_until_ready(call())
    return time.perf_counter() - start


def interleave(arms, repeats):
    """Seconds {name: [repeats]} of the arms {name: call}: A B A B, compiled before."""
    times = {name: [] for name in arms}
    for call in arms.values():
        seconds(call)
    for _ in range(repeats):
        for name, call in arms.items():
            times[name].append(seconds(call))
    return times


def rates(what, times, work, *, note=""):
    """A row of rays/s from the seconds of `ours` and, where there is one, `peer`."""
    row = {"what": what, "unit": "rays/s", "note": note}
    row |= {name: spread(work / s for s in own) for name, own in times.items()}
    if "peer" in times:
        pairs = zip(times["ours"], times["peer"], strict=True)
        row["ratio"] = spread(peer / ours for ours, peer in pairs)
    return row


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
