"""One training step of every system of the paper's tables, at its published size.

A few rays: on a CPU a published batch takes minutes. Steps of all systems take turns.
"""

from tests.bench import cases, measure, ours

RAYS = 64
SYSTEMS = {
    "NeRF": {"kind": "nerf"},
    "mip-NeRF": {"kind": "mipnerf"},
    "mip-NeRF, bigger": {"kind": "mipnerf", "width": 1024, "bottleneck": 1024},
    "NeRF++": {"kind": "nerfpp"},
    "NeRF++, bigger": {"kind": "nerfpp", "width": 512, "bottleneck": 512},
    "Instant-NGP": {"kind": "ngp"},
    "mip-NeRF 360": cases.PUBLISHED,
}


def run(options):
    """Rows: rays a second of a step of each."""
    systems, rays = SYSTEMS, RAYS
    if options.quick:
        systems, rays = {"NeRF": {"kind": "nerf", "width": 8, "samples": [4, 4]}}, 8
    arms = {
        name: ours.Training(cases.make_job(model, batch_rays=rays), cases.orbit())
        for name, model in systems.items()
    }
    times = measure.interleave(arms, max(1, options.repeats // 2))
    return [
        measure.rates(f"train {name}, {rays} rays", {"ours": found}, rays)
        for name, found in times.items()
    ]
