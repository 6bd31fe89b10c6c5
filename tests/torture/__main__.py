"""`make torture`: the attack on the program, and its report.

Parts: inputs (a finished chain's files, folders of photos, configs and jobs), folders
(grown from the seed), names, environments, numbers, kills, stops, disks, company,
matching, clocks, memory. Writes report.csv and findings.txt; exits with 1 where
anything was found. The whole takes some three hours on two cores; `--only numbers`
takes a minute.
"""

import argparse
import functools
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

from alignerf.experiment import check
from alignerf.files import progress, provenance
from tests.torture import (
    captures,
    chains,
    configs,
    damage,
    environments,
    grown,
    interrupts,
    machines,
    matching,
    names,
    numbers,
    stages,
)

ROOT = Path(__file__).resolve().parents[2]
# It measures this machine, for half a minute each time.
NOT_ATTACKED = ("alignerf.preflight",)


def main(argv=None):
    args = parse(argv)
    os.environ["PYTHONPATH"] = str(ROOT)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    args.out.mkdir(parents=True, exist_ok=True)
    reference = reference_of(args.out / "reference")
    print(f"seed {args.seed}", flush=True)
    rows, said = [], []
    for name in args.only or PARTS:
        started = time.monotonic()
        rng = np.random.default_rng(args.seed)
        for what, cases, found in PARTS[name](reference, args, rng):
            minutes = (time.monotonic() - started) / 60
            count = "" if found is None else len(found)
            rows.append([name, what, cases, count, round(minutes, 1)])
            said += [f"{name}, {what}: {line}" for line in found or ()]
            print(f"{name}, {what}: {cases} cases, {count} findings", flush=True)
    write(rows, said, args.out)
    return int(bool(said))


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="tests.torture", description=__doc__)
    parser.add_argument("--only", nargs="*", choices=PARTS, help="these parts")
    today = int(time.strftime("%Y%m%d"))
    parser.add_argument(
        "--seed", type=int, default=today, help="(default: the date, another each day)"
    )
    parser.add_argument("--cases", type=int, default=300, help="folders a source")
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "torture")
    parser.add_argument(
        "--ways", type=int, default=4, help="tried on each input of each stage"
    )
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument(
        "--environments", type=int, default=40, help="stages under one each"
    )
    parser.add_argument("--names", type=int, default=2000, help="of folders and views")
    return parser.parse_args(argv)


def reference_of(folder):
    """A finished chain: made once, and kept."""
    chain = chains.Chain(ROOT, folder)
    if not (folder / "results" / chains.SCENE / "index.html").exists():
        chain = chains.make(ROOT, folder)
        chains.finish(chain)
    return chain


def of_stages(reference, args, rng):
    """Every input of every stage, in some of the ways in which it may be damaged."""
    choice = random.Random(args.seed)
    cases = []
    for stage in stages.plan(ROOT, reference.folder, "tiny.yaml"):
        if stage.module in NOT_ATTACKED:
            continue
        for path in stages.inputs_of(stage, reference.folder):
            ways = list(damage.ways_of(reference.folder / path))
            chosen = choice.sample(ways, min(args.ways, len(ways)))
            cases += [(stage, path, way) for way in chosen]

    def attack(case):
        place = args.out / "place"
        found, ended = stages.attack(*case, reference.folder, place, rng)
        stage, path, way = case
        if ended is None:
            return False
        return found and f"{stage.module}, {path}, {way}: {found}"

    yield "files of a chain", *tried(attack, cases)


def of_captures(reference, args, rng):
    """Every file of a folder of each source, in every way."""
    for source in captures.SOURCES:
        place = args.out / "capture"
        base = captures.make(source, reference.folder, place / "whole")
        folder = base.parent if source == "photos" else base
        cases = list(captures.cases(source, folder))

        def attack(case, source=source):
            path, name, way = case
            where = args.out / "place"
            found, ended = captures.attack(
                source, path, way, reference.folder, where, rng
            )
            if ended is None:
                return False
            return found and f"{path}, {name}: {found}"

        yield f"a folder of {source}", *tried(attack, cases)
        shutil.rmtree(place)


def of_folders(reference, args, rng):
    """Folders grown from the seed, spoilt at random; each source in its own process.

    A process that ends otherwise than by itself is a finding, with its last case.
    """
    for source in grown.SOURCES:
        words = ["--source", source, "--cases", str(args.cases)]
        command = [sys.executable, "-m", "tests.torture.generated", *words]
        done = subprocess.run(
            [*command, "--seed", str(args.seed)],
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
        lines = done.stdout.splitlines()
        cases = [line for line in lines if line.startswith('{"case"')]
        found = [line for line in lines if line not in cases]
        if done.returncode:
            found.append(f"exit {done.returncode} at {cases[-1:]}")
        yield f"grown folders of {source}", len(cases), found


def of_configs(reference, args, rng):
    """Every key of a config and of a job, with every hostile value."""
    config = configs.complete(yaml.safe_load(chains.CONFIG))
    sweep = yaml.safe_load((ROOT / "workflow/config/demo.yaml").read_text())
    whole = [config, check.checked(sweep)]

    def attack(case, taken):
        place, value, changed = case
        found, _ = taken(changed, place)
        return found and f"{'.'.join(map(str, place))} = {value!r:.40}: {found}"

    cases = [case for one in whole for case in configs.cases_of(one)]
    of_config = functools.partial(attack, taken=configs.of_config)
    yield "keys of a config", *tried(of_config, cases)
    cases = list(configs.cases_of(configs.job_of(config)))
    of_job = functools.partial(attack, taken=configs.of_job)
    yield "keys of a job", *tried(of_job, cases)


def tried(attack, cases):
    """(how many applied, what was found); `attack` says False where a case does not."""
    found = [attack(case) for case in progress.over(cases, "attack", unit="case")]
    return sum(one is not False for one in found), [one for one in found if one]


def of_numbers(reference, args, rng):
    for name in numbers.FUNCTIONS:
        yield name, numbers.CASES, numbers.check(name, rng)


def of_environments(reference, args, rng):
    """Stages of the chain, each under variables drawn at random."""
    random_ = random.Random(args.seed)
    known = environments.variables()
    found = stages.plan(ROOT, reference.folder, "tiny.yaml")
    found = [stage for stage in found if stage.module not in NOT_ATTACKED]
    cases = [
        (random_.choice(found), environments.drawn(random_, known))
        for _ in range(args.environments)
    ]

    def attack(case):
        stage, environment = case

        def bad(variables):
            place = args.out / "place"
            return environments.attack(stage, variables, reference.folder, place)

        if not bad(environment):
            return None
        least = environments.smallest(environment, bad)
        return f"{stage.module}, {least}: {bad(least)}"

    yield "variables of the environment", *tried(attack, cases)


def of_names(reference, args, rng):
    """Names of folders and of views, made of parts that some reader trips over."""
    random_ = random.Random(args.seed)
    cases = [names.drawn(random_) for _ in range(args.names)]
    for what, way in (("tables", names.of_table), ("folders", names.of_folder)):

        def attack(name, way=way):
            with tempfile.TemporaryDirectory() as folder:
                return way(name, Path(folder), random_)

        yield f"names in {what}", *tried(attack, cases)


def of_kills(reference, args, rng):
    found, done = interrupts.killed(reference, args.out / "kills", args.kills, rng)
    yield "kill -9 of the chain", done, found
    found, done = interrupts.trainings(reference, args.out / "kills", 16, rng)
    yield "kill -9 of a training", done, found


def of_stops(reference, args, rng):
    found = interrupts.stopped(reference, args.out / "stops", rng)
    yield "SIGTERM and Ctrl-C", 2, found


def of_machine(function, what, cases):
    def part(reference, args, rng):
        yield what, cases, function(reference, args.out / "machine")

    return part


PARTS = {
    "numbers": of_numbers,
    "configs": of_configs,
    "captures": of_captures,
    "names": of_names,
    "environments": of_environments,
    "folders": of_folders,
    "stages": of_stages,
    "kills": of_kills,
    "stops": of_stops,
    "disks": of_machine(machines.full_disks, "full disks", len(machines.DISK_MIB)),
    "users": of_machine(machines.unwritable, "a folder of another user", 1),
    "company": of_machine(machines.side_by_side, "two chains, one cache", 3),
    "matching": of_machine(matching.beside_others, "pairs of photos", matching.PAIRS),
    "clocks": of_machine(machines.clock_set_back, "files of tomorrow", 1),
    "memory": of_machine(machines.memory_growth, "a long training's memory", 1),
}


def write(rows, said, out):
    """The table, and all findings in words."""
    columns = ["part", "what", "cases", "findings", "minutes"]
    pd.DataFrame(rows, columns=columns).to_csv(out / "report.csv", index=False)
    (out / "findings.txt").write_text("".join(f"{line}\n" for line in said))
    path = provenance.path_beside(out / "report.csv")
    path.write_text(provenance.as_json(provenance.facts()))
    print(f"{len(said)} findings: {out / 'findings.txt'}")


if __name__ == "__main__":
    sys.exit(main())
