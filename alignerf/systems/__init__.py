"""The registry of systems: one file each, which holds one class called SYSTEM.

A system is a class of a model's keys (`base.System`): it knows which learning rates
suit it, what does not go together, and makes its network (`made`). What follows a ray
lies in `rays`. Other packages add systems by the entry points `alignerf.systems`.
"""

import sys

from alignerf.io.environment import extensions


def every():
    """{kind: class} of all systems; the first is what a model without a kind is."""
    found = extensions.registered(sys.modules[__name__], "systems", "SYSTEM")
    kinds = [system.default("kind") for system in found]
    extensions.check_new("systems", kinds, ())
    return dict(zip(kinds, found, strict=True))
