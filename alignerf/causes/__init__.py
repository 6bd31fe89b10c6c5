"""The registry of causes: what can be wrong with a scene, a file each.

A file has one `base.Cause` as `CAUSE`, or a list of them. A new file in this folder, or
a record of another package under the entry points `alignerf.causes`, is all that a new
cause takes. Thresholds were chosen on variants of courtyard with one fault each, seed
1, those of motion and of the lens on seeds 0 to 4. They were tested on other seeds, on
pairs of faults and on real captures: docs/evidence/verdict.md.
"""

import sys

from alignerf.io.environment import extensions


def every():
    """All causes, in the order in which they are shown."""
    return extensions.registered(sys.modules[__name__], "causes", "CAUSE")


def find(e):
    """A `base.Finding` of each cause that applies to an Evidence, the gravest first."""
    by_gravity = sorted(every(), key=lambda cause: cause.order[1])
    found = [finding for cause in by_gravity if (finding := cause.find(e))]
    # Too many pairs that are none, the gravest of all, say that nothing else can be.
    return found[:1] if e.pairs.stops else found
