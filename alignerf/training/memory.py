"""The memory that a training takes, and the free memory, in bytes.

The compiler says how much a step needs besides its inputs. A batch that does not fit
is split into as few micro-batches as possible.
"""

import contextlib
import ctypes
import logging
import os
import pathlib

import jax

log = logging.getLogger("alignerf")

# Of the free memory: the rest is for fragments and for what others take meanwhile.
USABLE = 0.9
# The GNU C library's names for what it gives back, and in how large pieces.
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, KEPT_BYTES = -1, -3, 2**30
UNITS = ("B", "kB", "MB", "GB", "TB")
# A container's limit, use, and name of its pages of files, which can be dropped.
CONTAINERS = (
    ("sys/fs/cgroup", "memory.max", "memory.current", "inactive_file"),
    (
        "sys/fs/cgroup/memory",
        "memory.limit_in_bytes",
        "memory.usage_in_bytes",
        "total_inactive_file",
    ),
)


def free_bytes(device) -> int:
    """Free memory of a device; a CPU's is that of the host."""
    stats = device.memory_stats()
    if stats and "bytes_limit" in stats:
        return stats["bytes_limit"] - stats["bytes_in_use"]
    return free_host_bytes()


def free_host_bytes(root="/") -> int:
    """Memory that this process can still take, of the machine and of its containers."""
    root = pathlib.Path(root)
    return max(0, min([_free_of_machine(root), *_free_of_containers(root)]))


def _free_of_machine(root):
    try:
        lines = (root / "proc/meminfo").read_text().splitlines()
    except OSError:
        # Not Linux: all memory that there is.
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    (available,) = (line for line in lines if line.startswith("MemAvailable:"))
    return int(available.split()[1]) * 1024


def _free_of_containers(root):
    """Free memory under the limit of each control group of this process."""
    try:
        groups = (root / "proc/self/cgroup").read_text().splitlines()
    except OSError:
        return
    names = {pathlib.Path(line.split(":", 2)[2].strip("/")) for line in groups}
    for mount, limit_file, used_file, cache_name in CONTAINERS:
        # The groups themselves and those around them.
        paths = {path for name in names for path in (name, *name.parents)}
        for folder in (root / mount / path for path in paths):
            try:
                limit = int((folder / limit_file).read_text())
                used = int((folder / used_file).read_text())
                pages = (folder / "memory.stat").read_text().splitlines()
            except (OSError, ValueError):
                # No such group, or its limit is "max".
                continue
            yield limit - used + int(dict(map(str.split, pages)).get(cache_name, 0))


def step_bytes(compiled, devices) -> int:
    """Memory that a compiled step takes on a device, besides its inputs.

    CPU devices, which report no memory of their own, share the host's.
    """
    analysis = compiled.memory_analysis()
    fresh = analysis.output_size_in_bytes - analysis.alias_size_in_bytes
    sharing = len(devices) if devices[0].memory_stats() is None else 1
    return sharing * (analysis.temp_size_in_bytes + fresh)


def tree_bytes(tree) -> int:
    """Size of all arrays of a tree, or of their shapes."""
    return sum(leaf.size * leaf.dtype.itemsize for leaf in jax.tree.leaves(tree))


def keep_freed():
    """Let freed memory stay with the process, in pieces of up to a GiB.

    A step computes in one large piece of memory, which glibc may give back after each
    step and take anew, page by page: up to a third of a large step's time on a CPU.
    """
    with contextlib.suppress(OSError, AttributeError):
        adjust = ctypes.CDLL(None).mallopt
        adjust(M_MMAP_THRESHOLD, KEPT_BYTES)
        adjust(M_TRIM_THRESHOLD, KEPT_BYTES)


def give_back():
    """Return freed memory to the system: compiling leaves half a gigabyte of it."""
    # Only the GNU C library keeps it, and has the function.
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def check(needed, free, what):
    """ValueError where `what` does not fit."""
    if needed > USABLE * free:
        sizes = f"{text(needed)} do not fit into {text(free)} of free memory"
        raise ValueError(f"{what} of {sizes}")


def compile_to_fit(compile_in, units, free, *, micro_batches=1):
    """(compiled step, its micro-batches): the fewest that fit the free bytes.

    compile_in(micro_batches) -> (compiled step, bytes that it takes). The numbers that
    are tried divide the units. ValueError where not even a single unit fits.
    """
    while True:
        compiled, needed = compile_in(micro_batches)
        if needed <= USABLE * free:
            return compiled, micro_batches
        sizes = f"{text(needed)}, more than {USABLE:.0%} of {text(free)}"
        log.info("memory: a step takes %s, in %d micro-batches", sizes, micro_batches)
        # At least as many as would do if all of it were activations.
        enough = max(2 * micro_batches, micro_batches * needed / max(USABLE * free, 1))
        more = [n for n in range(micro_batches + 1, units + 1) if units % n == 0]
        if not more:
            check(needed, free, "config.model: activations of a ray or patch,")
        micro_batches = next((n for n in more if n >= enough), more[-1])


def text(size):
    """Bytes as people say them."""
    power = 0
    while size >= 1000 and power < len(UNITS) - 1:
        size, power = size / 1000, power + 1
    return f"{size:.1f} {UNITS[power]}"
