"""Memory: what is free, and micro-batches where a step does not fit."""

import pytest

from alignerf.training import memory

MEMINFO = "MemTotal: 9000 kB\nMemFree: 10 kB\nMemAvailable:    8000 kB\n"


def machine(root, files):
    """A root folder with these files, {path: text}."""
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


def test_a_machine_without_limits(tmp_path):
    root = machine(tmp_path, {"proc/meminfo": MEMINFO})
    assert memory.free_host_bytes(root) == 8000 * 1024
    files = {
        "proc/self/cgroup": "0::/\n",
        "sys/fs/cgroup/memory.max": "max\n",
        "sys/fs/cgroup/memory.current": "5\n",
        "sys/fs/cgroup/memory.stat": "inactive_file 1\n",
    }
    assert memory.free_host_bytes(machine(tmp_path, files)) == 8000 * 1024


def test_a_system_without_proc_has_its_physical_memory(tmp_path):
    assert memory.free_host_bytes(tmp_path) > 2**28


@pytest.mark.parametrize("limited", ["job/step", "job", ""])
def test_a_limit_around_the_process_counts(tmp_path, limited):
    """Version 2: files of the cache can be dropped, and are no use."""
    group = f"sys/fs/cgroup/{limited}"
    files = {
        "proc/meminfo": MEMINFO,
        "proc/self/cgroup": "0::/job/step\n",
        "sys/fs/cgroup/job/step/memory.max": "max\n",
        f"{group}/memory.max": "4000000\n",
        f"{group}/memory.current": "1500000\n",
        f"{group}/memory.stat": "anon 1000000\ninactive_file 500000\n",
    }
    assert memory.free_host_bytes(machine(tmp_path, files)) == 3_000_000


def test_a_limit_of_version_1_counts(tmp_path):
    group = "sys/fs/cgroup/memory/docker/a:b"
    files = {
        "proc/meminfo": MEMINFO,
        "proc/self/cgroup": "5:cpu:/\n4:memory:/docker/a:b\n0::/\n",
        "sys/fs/cgroup/memory/memory.limit_in_bytes": "9223372036854771712\n",
        "sys/fs/cgroup/memory/memory.usage_in_bytes": "9000000\n",
        "sys/fs/cgroup/memory/memory.stat": "total_inactive_file 0\n",
        f"{group}/memory.limit_in_bytes": "2000000\n",
        f"{group}/memory.usage_in_bytes": "1900000\n",
        f"{group}/memory.stat": "cache 10\ntotal_inactive_file 100000\n",
    }
    assert memory.free_host_bytes(machine(tmp_path, files)) == 200_000
    files[f"{group}/memory.usage_in_bytes"] = "9900000\n"
    assert memory.free_host_bytes(machine(tmp_path, files)) == 0


def fit(free, *, units=24, fixed=100, each=10, micro_batches=1):
    """A step of fixed + each * units / micro_batches bytes: micro-batches and tries."""
    tried = []

    def compile_in(micro_batches):
        assert units % micro_batches == 0
        tried.append(micro_batches)
        return f"in {micro_batches}", fixed + each * units / micro_batches

    compiled, micro_batches = memory.compile_to_fit(
        compile_in, units, free, micro_batches=micro_batches
    )
    assert compiled == f"in {micro_batches}"
    assert tried[-1] == micro_batches
    return micro_batches, tried


def test_as_few_micro_batches_as_fit_in_few_tries():
    usable = memory.USABLE
    assert fit(341 / usable) == (1, [1])
    assert fit(339 / usable) == (2, [1, 2])
    assert fit(200 / usable)[0] == 3 or fit(200 / usable)[0] == 4
    micro_batches, tried = fit(110.01 / usable)
    assert micro_batches == 24
    assert len(tried) <= 5
    # Never fewer than those of a checkpoint, whose rounding they keep.
    assert fit(10_000, micro_batches=6) == (6, [6])


@pytest.mark.parametrize("free", [0, 50, 109])
def test_what_fits_in_no_way_is_one_clear_line(free):
    with pytest.raises(ValueError, match=r"config\.model: act.* of 110\.0 B do not"):
        fit(free)


def test_sizes_are_readable():
    sizes = {0: "0.0 B", 999: "999.0 B", 53e6: "53.0 MB", 2.19e9: "2.2 GB"}
    assert {size: memory.text(size) for size in sizes} == sizes
    assert memory.text(3e18) == "3000000.0 TB"
