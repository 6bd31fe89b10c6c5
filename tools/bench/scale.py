"""Our training rays/s against batch size, samples a ray, and number of devices.

Devices are those that a CPU is made to show as several: they share its cores, so
that the figures tell what dividing the work costs, not what more devices would gain.
"""

import json
import sys

from tools.bench import cases, measure, ours

SAMPLES = ([16, 8], [32, 16], [64, 32], [64, 64, 32])


def run(options):
    """Rows: one sweep after the other; the rest is as in the default config."""
    if options.quick:
        sweeps = [("tiny", cases.TINY, (), (), (2,), 16)]
    else:
        sweeps = [
            ("grid", cases.GRID, (256, 1024, 4096, 16384), SAMPLES, (1, 2, 4, 8), 1024),
            ("mlp", cases.SMALL, (128, 512, 2048), (), (), 1024),
        ]
    repeats = max(1, options.repeats // 2)
    rows = []
    for name, model, batches, all_samples, counts, batch in sweeps:
        for size in batches:
            times = time_steps(model, size, repeats)
            rows.append(_row(f"{name}, batch {size}", times, size))
        for samples in all_samples:
            times = time_steps(model | {"samples": samples}, batch, repeats)
            rows.append(_row(f"{name}, samples {samples}", times, batch))
        for count in counts:
            times = _elsewhere(count, model, batch, repeats)
            rows.append(_row(f"{name}, {count} CPU devices", times, batch))
    return rows


def _row(what, times, batch):
    return measure.rates(f"train {what}", {"ours": times}, batch)


def time_steps(model, batch, repeats):
    """Seconds of each step, compiled before."""
    training = ours.Training(cases.make_job(model, batch_rays=batch), cases.orbit())
    return measure.interleave({"step": training}, repeats)["step"]


def _elsewhere(count, model, batch, repeats):
    """The same in a process in which the CPU shows as `count` devices."""
    flags = f"--xla_force_host_platform_device_count={count}"
    environment = {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu"}
    request = {"model": model, "batch": batch, "repeats": repeats}
    return measure.elsewhere("tools.bench.scale", request, **environment)


if __name__ == "__main__":
    print(json.dumps(time_steps(**json.loads(sys.argv[1]))))
