"""What `snakemake SCENE` makes, and what it says in the end."""

import atexit
import os
import re
import shlex
import shutil
import types
from pathlib import Path

from alignerf.captures import base
from alignerf.experiment import cluster, layout
from alignerf.experiment.tables import shipped
from alignerf.io import (
    faults,
    json_files,
    machine,
    provenance,
    yaml_files,
)

# Of the config that runs, beside what the paper prints.
COMPARISON = f"{layout.RESULTS}/comparison.csv"
TABLES = ("misalignment", "controls", "displacement")
FIGURES = ("flow", "rounds", "lengths", "curves", "crops")


def tables(known):
    """Where the truth is known, also whether other test sets rank as it does."""
    return (*TABLES, "ranking") if known else TABLES


def of_scene(experiment, scene):
    """What `snakemake SCENE` is run for; what leads there is made too."""
    return [*of_page(experiment, scene), page_of(scene)]


def page_of(scene, results="results"):
    """The page of a scene, by its path."""
    return f"{results}/{scene}/index.html"


def of_run(experiments):
    """What a run makes that is asked for nothing: its scenes, its printed table."""
    first = experiments.by_name.get("")
    if first is None:
        raise ValueError(
            "config: small: false needs full_size, which the demo has not: name a "
            "table, as in `snakemake table1 --config small=false`"
        )
    made = [file for name in first.captures() for file in of_scene(first, name)]
    return [*made, *[COMPARISON] * (first.config.published_table is not None)]


def of_figures(experiments, narrowed=types.MappingProxyType({})):
    """The paper's figures: those of a scene of Table 1, and of the moving arm."""
    if not {shipped.FIGURES, "table1"} <= experiments.by_name.keys():
        return []
    at = layout.Scene(drawn(experiments, narrowed))
    arm = [f"{layout.RESULTS}/arm.{end}" for end in ("csv", "tex", "png")]
    return [*map(at.figure, FIGURES), *arm]


def drawn(experiments, narrowed):
    """The scene of Table 1 that figures are of: the one asked for, else the first."""
    own = experiments.by_name["table1"].captures()
    asked = [one for one in narrowed.get(shipped.FIGURES, ()) if one in own]
    return [*asked, *own][0]


def unasked(experiments):
    """The option of `alignerf.facts` where the config decides nothing by facts."""
    first = experiments.by_name.get("")
    return [] if first and first.config.decide else ["--unasked"]


def of_page(experiment, scene):
    """What a scene's page shows, or leads to, besides images."""
    at = layout.Scene(scene)
    every = [at.config, at.poses, at.verdict, at.views, at.transients]
    if not experiment.capture(scene).trains:
        # Nothing is trained, so nothing is decided, scored or compared.
        return every
    return [
        *every,
        at.facts,
        at.decisions,
        *(
            at.table(name, kind)
            for name in tables(experiment.has_truth(scene))
            for kind in ("csv", "tex")
        ),
        *map(at.figure, FIGURES),
    ]


def preflight_of(experiment, scene):
    """What a run was to cost, where something is trained, and that is asked for.

    Of crops of a scene it is the scene's.
    """
    own = experiment.capture(scene).trains and not experiment.parent(scene)
    file = layout.Scene(scene).preflight
    return [file] if own and experiment.config.preflight else []


def demo_scenes():
    """Names of the scenes of the demo's config, which runs where none is named."""
    return list(yaml_files.read(shipped.DEMO)["scenes"])


def export_command(configs):
    """The command that writes a run's files for other programs.

    configs: files that the command line names; one in results/ is `make photos`'s, none
    the demo's. The target comes before `--configfile`, which takes all words after it.
    """
    paths = [Path(os.path.relpath(path)) for path in configs]
    name = None if paths else demo_scenes()[0]
    if len(paths) == 1 and paths[0].parent == Path("results"):
        name = paths[0].stem
    if name is not None:
        return provenance.typed(
            f"make export SCENE={name}", f"why-blurry export {name}"
        )
    words = ["snakemake", "--cores", str(machine.cores()), "export"]
    return shlex.join([*words, "--configfile", *map(str, paths)])


# What a verdict.json holds that is read here; that of an earlier version has less.
PAIRS = json_files.OrNone({"stops": json_files.OrNone(bool)})
VERDICT = {"verdict": [str], "evidence": json_files.OrNone({"pairs": PAIRS})}
CAUSES = {"causes": json_files.OrNone([{"cause": str, "level": str}])}


def verdicts(scenes, export="", results="results"):
    """Lines of the verdicts that are there, a scene's name before them.

    export: as of `export_command`; said last.
    """
    lines, useful = [], False
    for scene in scenes:
        path = Path(results) / scene / "verdict.json"
        if path.is_file():
            found = json_files.read(path, VERDICT)
            said = [f"  {faults.one_line(line)}" for line in found["verdict"]]
            lines += ["", scene, *said]
            pairs = (found.get("evidence") or {}).get("pairs") or {}
            useful |= not pairs.get("stops")
            if Path(page_of(scene, results)).is_file():
                lines.append(f"  Page: {page_of(scene, results)}")
    if useful and export:
        lines += ["", f"For nerfstudio, Gaussian splatting and COLMAP: {export}"]
    return lines


# What Snakemake says of Ctrl-C, and of SIGTERM.
STOPPED = "Terminating processes on user request"
AS_ASKED = "stopped, as asked."
GOES_ON = "What is finished stays. The same command goes on from there."
# How Snakemake names the log of a job that failed; the second also where it is quiet.
FAILED_LOGS = (
    re.compile(r"log: (.*) \(check log file\(s\) for error details\)"),
    re.compile(r"\| tee (.*)' returned non-zero exit status"),
    re.compile(r"> (\S+|'[^']*') 2>&1' returned non-zero exit status"),
)


def causes(snakemake_logs):
    """Lines on what stopped a run: each failed job's own last word, and what to do.

    snakemake_logs: files that Snakemake has written of the run. None is found where no
    job has failed, as when the plan itself was wrong.
    """
    logs, ended = [], []
    for path in snakemake_logs:
        text = Path(path).read_text(encoding="utf-8", errors="replace")
        if STOPPED in text:
            return [AS_ASKED, GOES_ON]
        named = [found for one in FAILED_LOGS for found in one.findall(text)]
        # The second quotes a name with spaces.
        of_jobs = [log.strip("'") for names in named for log in names.split(", ")]
        ended += cluster.slurm_errors(text, of_jobs)
        logs += [log for log in of_jobs if not cluster.is_slurms(log)]
    paths = map(Path, dict.fromkeys(logs))
    found = ended + [line for path in paths for line in cause(path)]
    if found:
        found.append(GOES_ON)
    return found


def replaced(dag):
    """Folders that Snakemake removes before their jobs write them anew."""
    outputs = (file for job in dag.needrun_jobs() for file in job.output)
    # What is updated its job finds as it is, and puts its own files into.
    return [f for f in outputs if f.is_directory and not f.flags.get("update")]


def tidy(scenes):
    """Remove copies of outputs that Snakemake has put aside, and will not overwrite."""
    for name in scenes:
        shutil.rmtree(f".snakemake/backups/results/{name}", ignore_errors=True)


def written(dag):
    """All files of jobs that will run, their logs among them."""
    return [one for job in dag.needrun_jobs() for one in (*job.output, *job.log)]


def say_in_the_end(lines):
    """Print lines when the process ends, after whatever else it prints until then."""
    if lines:
        atexit.register(print, "\n".join(["", *lines]))


def cause(log):
    """The last error of a job's log, else its last line; where it lies, behind it."""
    if not log.is_file():
        return []
    text = log.read_text(encoding="utf-8", errors="replace")
    # A progress bar writes over its line.
    lines = [line.split("\r")[-1].strip() for line in text.splitlines()]
    lines = [faults.one_line(line) for line in lines if line]
    errors = [line for line in lines if line.startswith("error: ")]
    if errors:
        return [errors[-1], f"  in {log}"]
    if "Traceback (most recent call last):" in lines:
        return [f"error: {lines[-1]}", f"  in {log}"]
    said = f"; its last line: {lines[-1]}" if lines else ""
    return [
        "error: a job stopped without a word (killed, or out of memory?)" + said,
        f"  in {log}",
    ]


def can_export(experiment):
    """Whether any scene may have an export."""
    return any(base.of(one).can_export(one) for one in experiment.scenes.values())


def of_exports(experiments):
    """Those of the config that runs; ValueError where only tables do."""
    if "" not in experiments.by_name:
        raise ValueError("config: small: false: only scenes of a config are exported")
    return exports(experiments.by_name[""])


def exports(experiment):
    """Folders for other programs: what the last round of each method was trained on.

    Its cameras with the photos as taken and, where it learnt from warped photos, with
    these. Of renders that are judged, what `of_judged` says, where `can_export` of its
    record allows it.
    """
    folders = []
    for scene in experiment.captures():
        capture = experiment.capture(scene)
        if not capture.trains:
            method = experiment.config.reference.method
            whats = of_judged(scene) * capture.can_export(experiment.scenes[scene])
            folders += [layout.Scene(scene).export(method, what) for what in whats]
            continue
        for method in experiment.methods:
            last = experiment.methods[method].rounds
            training = experiment.at(scene, method, last)
            at = layout.Scene(scene)
            if last > 0 or moves_cameras(training):
                folders.append(at.export(method, "cameras"))
            if training.warped:
                folders.append(at.export(method, "photos"))
    return folders


def of_judged(scene):
    """What is exported of renders that are judged: photos only where things moved.

    Both, where no verdict is there.
    """
    path = Path(layout.Scene(scene).verdict)
    if not path.is_file():
        return ("cameras", "photos")
    told = json_files.read(path, CAUSES).get("causes") or []
    named = {one["cause"] for one in told if one["level"] in ("faulty", "likely")}
    return ("cameras", "photos") if "motion" in named else ("cameras",)


def moves_cameras(training):
    """Whether a training's renders are seen by other cameras than those given."""
    given = layout.Scene(training.scene).cameras
    return training.cameras != given or "cameras" in training.job.moves
