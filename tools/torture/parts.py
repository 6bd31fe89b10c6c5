"""The parts of the torture, in rows: what, how many cases of how many, findings.

A part is a function(reference, args, clock): the finished chain, the command line, and
the `clock.Clock` that says when to stop. Findings are None where this machine lets a
part not be tried.
"""

import contextlib
import functools
import math
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from alignerf.experiment import check
from tools.torture import (
    arguments,
    chains,
    configs,
    damage,
    grown,
    interrupts,
    machines,
    names,
    numbers,
    pool,
    stages,
    surfaces,
    trees,
)

ROOT = Path(__file__).resolve().parents[2]
# It measures this machine, for half a minute each time.
NOT_ATTACKED = ("alignerf.costs",)
# Of a chain after the last kill, to the end; of a training, and of one without kills.
LAST_RUN_S, LAST_TRAINING_S = 120.0, 90.0


class Row(NamedTuple):
    """A line of the report."""

    what: str
    cases: int
    of: int
    found: list | None


def attacked(what, attack, cases, args, clock, *, among=1, workers=pool.WORKERS):
    """A row of many cases, in the time of one of so many rows of a part."""
    found = pool.tried(
        attack,
        cases,
        until=clock.of_next(among),
        places=[args.work / f"place{number}" for number in range(workers)],
        seed=args.seed,
    )
    return Row(what, *found)


def stages_of(reference, args):
    """{what: (its finished folder, its stages)} of a chain, and of judged renders."""
    judged = chains.judged(ROOT, args.work / "judged")
    return {
        what: (folder, [s for s in found if s.module not in NOT_ATTACKED])
        for what, folder, found in (
            ("a judgement", judged.folder, planned(judged, chains.JUDGED)),
            ("a chain", reference.folder, planned(reference, chains.SCENE)),
        )
    }


def planned(chain, name):
    """The stages of a finished chain."""
    config = f"results/{name}.yaml" if name == chains.JUDGED else f"{name}.yaml"
    return stages.plan(ROOT, chain.folder, config)


def of_stages(reference, args, clock):
    """Every input of every stage, in some of the ways in which it may be damaged."""
    choice = random.Random(args.seed)
    for what, (folder, found) in stages_of(reference, args).items():
        cases = []
        for stage in found:
            for path in stages.inputs_of(stage, folder):
                ways = list(damage.ways_of(folder / path))
                chosen = choice.sample(ways, min(args.ways, len(ways)))
                cases += [(stage, path, way) for way in chosen]

        def attack(case, place, rng, folder=folder):
            found, ended = stages.attack(*case, folder, place, rng)
            stage, path, way = case
            if ended is None:
                return False
            return found and f"{stage.module}, {path}, {way}: {found}"

        # A judgement's stages end sooner.
        among = {"a judgement": 4}.get(what, 1)
        yield attacked(f"files of {what}", attack, cases, args, clock, among=among)


def of_folders(reference, args, clock):
    """Folders grown from the seed, spoilt at random; each source in its own process.

    A process that ends otherwise than by itself is a finding, with its last case.
    """
    sources = list(grown.SOURCES)
    for first in range(0, len(sources), pool.WORKERS):
        pair = sources[first : first + pool.WORKERS]
        left = math.ceil((len(sources) - first) / pool.WORKERS)
        limit_s = clock.of_next(left) - time.monotonic()
        one = functools.partial(of_source, args=args, limit_s=limit_s)
        yield from pool.together([functools.partial(one, source) for source in pair])


def of_source(source, args, limit_s):
    words = ["--source", source, "--cases", str(args.cases), "--seed", str(args.seed)]
    if limit_s < math.inf:
        words += ["--seconds", f"{max(limit_s, 0):.1f}"]
    done = subprocess.run(
        [sys.executable, "-m", "tools.torture.generated", *words],
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    lines = done.stdout.splitlines()
    cases = [line for line in lines if line.startswith('{"case"')]
    found = [line for line in lines if line not in cases]
    if done.returncode:
        found.append(f"exit {done.returncode} at {cases[-1:]}: {done.stderr[-300:]!r}")
    return Row(f"grown folders of {source}", len(cases), args.cases, found)


def of_configs(reference, args, clock):
    """Every key of a config and of a job, with every hostile value."""
    config = configs.complete(yaml.safe_load(chains.CONFIG))
    demo = yaml.safe_load((ROOT / "workflow/config/demo.yaml").read_text())
    every = [case for c in (config, check.checked(demo)) for case in places_of(c)]

    def attack(case, place, rng, taken):
        whole, at, value, change = case
        found, _ = taken(change(whole, at, value), at)
        return found and f"{'.'.join(map(str, at))} = {value!r:.40}: {found}"

    for what, cases, taken, among in (
        ("keys of a config", every, configs.of_config, 2),
        ("keys of a job", list(places_of(configs.job_of(config))), configs.of_job, 1),
    ):
        one = functools.partial(attack, taken=taken)
        yield attacked(what, one, cases, args, clock, among=among, workers=1)


def places_of(config):
    """Cases of a config, changed only when they are tried: there are thousands."""
    for case in configs.changes_of(config):
        yield config, *case


def of_numbers(reference, args, clock):
    for number, name in enumerate(numbers.FUNCTIONS):
        rng = np.random.default_rng([args.seed, number])
        if time.monotonic() < clock.until:
            yield Row(name, numbers.CASES, numbers.CASES, numbers.check(name, rng))
        else:
            yield Row(name, 0, numbers.CASES, [])


def of_arguments(reference, args, clock):
    """Arguments of every command, missing, doubled, and of what they cannot be."""
    choice = random.Random(args.seed)
    typed = arguments.commands_of_start(args.work / "start")
    planned = [
        arguments.Command(stage, folder)
        for folder, found in stages_of(reference, args).values()
        for stage in found
    ]

    def attack(case, place, rng):
        found = arguments.attack(case, place)
        return found and f"{case}: {found}"

    for what, commands, among in (("users", typed, 3), ("stages", planned, 1)):
        cases = []
        for command in commands:
            every = list(filter(arguments.is_short, arguments.cases_of(command)))
            cases += choice.sample(every, min(args.arguments, len(every)))
        yield attacked(f"commands of {what}", attack, cases, args, clock, among=among)


def of_names(reference, args, clock):
    """Names of folders and of views, made of parts that some reader trips over."""
    choice = random.Random(args.seed)
    cases = [names.drawn(choice) for _ in range(args.names)]
    for what, way, among in (
        ("tables", names.of_table, 4),
        ("folders", names.of_folder, 1),
    ):

        def attack(name, place, rng, way=way):
            with tempfile.TemporaryDirectory() as folder:
                return way(name, Path(folder), random.Random(int(rng.integers(2**31))))

        what = f"names in {what}"
        yield attacked(what, attack, cases, args, clock, among=among, workers=1)


def of_trees(reference, args, clock):
    """Trees of a user's folders and links, each under a command."""

    def attack(number, place, rng):
        place.mkdir(parents=True, exist_ok=True)
        with contextlib.chdir(place):
            return trees.attack(number, args.seed)

    cases = range(args.cases)
    yield attacked("trees of folders", attack, cases, args, clock, workers=1)


def of_surfaces(reference, args, clock):
    """What has come since, each by the generator that its tests have."""
    for number, (what, (cases, attack)) in enumerate(surfaces.EVERY.items()):
        among = len(surfaces.EVERY) - number
        yield attacked(what, attack, cases, args, clock, among=among, workers=1)


def of_kills(reference, args, clock):
    """Chains side by side, then the two kinds of trainings, each for half the time."""
    folder, rngs = args.work / "kills", np.random.default_rng(args.seed).spawn(4)
    until, kills = clock.of_next(2) - LAST_RUN_S, pool.shared(args.kills)
    chain = functools.partial(interrupts.killed, reference, until=until)
    ended = pool.together(
        functools.partial(chain, folder / str(i), kills=kills[i], rng=rngs[i])
        for i in range(pool.WORKERS)
    )
    found = [line for lines, _ in ended for line in lines]
    done = sum(done for _, done in ended)
    yield Row("kill -9 of the chain", done, args.kills, found)
    until = clock.of_next() - LAST_TRAINING_S
    training = functools.partial(
        interrupts.trainings, reference, kills=args.training_kills, until=until
    )
    ended = pool.together(
        functools.partial(training, folder / kind, kind, rng=rng)
        for kind, rng in zip(interrupts.KINDS, rngs[2:], strict=True)
    )
    for kind, (found, done, within) in zip(interrupts.KINDS, ended, strict=True):
        more = f", {within} within an alignment" if interrupts.KINDS[kind] else ""
        what = f"kill -9 of a {kind}{more}"
        yield Row(what, done, args.training_kills, found)


def of_machines(reference, args, clock):
    """What takes one core, two at a time."""
    rng = np.random.default_rng(args.seed)
    place = args.work / "machine"
    every = {
        "full disks": (machines.full_disks, len(machines.DISK_MIB)),
        "SIGTERM and Ctrl-C": (functools.partial(interrupts.stopped, rng=rng), 2),
        "a long training's memory": (machines.memory_growth, 1),
        "a folder of another user": (machines.unwritable, 1),
    }
    if not clock.has_room(SHARES["machines"]):
        yield from (Row(what, 0, cases, []) for what, (_, cases) in every.items())
        return
    found = pool.together(
        [functools.partial(one, reference, place) for one, _ in every.values()]
    )
    for (what, (_, cases)), said in zip(every.items(), found, strict=True):
        yield Row(what, cases if said is not None else 0, cases, said)


PARTS = {
    "numbers": of_numbers,
    "configs": of_configs,
    "names": of_names,
    "trees": of_trees,
    "surfaces": of_surfaces,
    "folders": of_folders,
    "arguments": of_arguments,
    "stages": of_stages,
    "kills": of_kills,
    "machines": of_machines,
}
# What needs no finished chain.
ALONE = {"numbers", "configs", "names", "trees", "surfaces"}
# Minutes of each of 20, on two cores. `stages` and `kills` start most processes; what
# runs in this process tries a thousand a minute. `machines` takes what it takes, and
# comes last.
SHARES = {
    "numbers": 0.5,
    "configs": 0.5,
    "names": 0.25,
    "trees": 0.5,
    "surfaces": 2.25,
    "folders": 3,
    "arguments": 1.5,
    "stages": 2.5,
    "kills": 6,
    "machines": 3,
}
