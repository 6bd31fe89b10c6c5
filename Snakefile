# AligNeRF (CVPR 2023), reproduced: from photos to tables. And why a NeRF or a splat is
# blurry.
#
#   snakemake --cores N                    make every scene of the default config
#   snakemake --cores N table1             make a table of the paper: table1 to table4
#   snakemake --cores N figures            draw the paper's figures, the moving arm too
#   snakemake --cores N tradeoff           compare what settings cost and bring
#   snakemake --cores N paper              make all of these, in hours of a CPU core
#   snakemake --cores N table1 --config small=false     at the paper's size
#   snakemake --cores N table3 fox_small   make a table of one of its scenes
#   snakemake --cores N courtyard          make one scene
#   snakemake --cores N preview            print what it will cost, before any training
#   snakemake --cores N export             write cameras and photos for other programs
#   snakemake --cores N comparison         compare all methods
#   snakemake --cores N download_360_v2    download the paper's scenes (17 GB)
# All targets: snakemake --list-target-rules. All rules: snakemake --list.
# Another config, after the target, since --configfile takes all words that follow:
#   snakemake --cores N export --configfile workflow/config/own_photos.yaml
# profiles/default holds the options that every command has.
import gc
import sys

sys.path.insert(0, workflow.basedir)

from snakemake.cli import get_argument_parser
from snakemake.settings.enums import Quietness
from snakemake.utils import min_version

from alignerf.costs import estimate as costs
from alignerf.experiment import (
    asked,
    check,
    cluster,
    layout,
    plan,
    sources,
    steps,
    targets,
)
from alignerf.experiment.checks import fetched, results
from alignerf.experiment.tables import scenes, shipped

min_version("9.0")
# A plan's jobs live until its end: of a large one, a sixth of the time goes into looking
# for garbage among them (docs/measured/planning.csv).
gc.set_threshold(1_000_000)


# The words of the command line: of the run's own process, not of its jobs', which make
# what they are told to.
words = [] if workflow.is_main_process else None
if workflow.is_main_process and "snakemake" in sys.argv[0].split("/")[-2:]:
    typed = get_argument_parser().parse_known_args()[0]
    words = typed.targets
    if asked.only_counts(typed):
        workflow.output_settings.quiet = {Quietness.RULES, Quietness.PROGRESS}

# A config of the user's differs from the defaults, and not from one that is shipped.
files = workflow.overwrite_configfiles
given = {"": config} if files else check.or_exit(shipped.configs, config)
experiments = check.or_exit(shipped.experiments, given, files, words)
wanted = check.or_exit(asked.Asked.of, experiments, words)
export_by = targets.export_command(files)
sources.set_environment(export_by)

# Of the rules: their jobs, patterns of their paths, and what they run.
step = steps.Rules(experiments, local)
scene, training = layout.Scene("{scene}"), layout.training("{scene}", "{training}")
tables = scenes.across(experiments, wanted.narrowed)
RUN = "python -m {params.command:q} 2>&1 | tee {log:q}"
RUN_IN_THREADS = "python -m {params.command:q} --threads {threads} 2>&1 | tee {log:q}"
RUN_ON_DEVICES = RUN_IN_THREADS.replace(" 2>", " --gpus {resources.gpu} 2>")


report: "workflow/report/workflow.rst"


wildcard_constraints:
    scene=plan.one_of(experiments.scenes),
    method=plan.one_of(experiments.methods),
    training=plan.folders(experiments.by_name.values()),
    round=r"0|[1-9]\d*",
    split="train|test",


include: "workflow/rules/data.smk"
include: "workflow/rules/scenes.smk"
include: "workflow/rules/preflight.smk"
include: "workflow/rules/trainings.smk"
include: "workflow/rules/alignment.smk"
include: "workflow/rules/scores.smk"
include: "workflow/rules/across.smk"
include: "workflow/rules/results.smk"


rule all:
    """Make every scene: tables, figures, verdict and page"""
    default_target: True
    input:
        lambda w: check.or_exit(targets.of_run, experiments),


rule figures:
    """Draw the paper's figures: flow, rounds, crops, the moving arm"""
    input:
        targets.of_figures(experiments, wanted.narrowed),


rule paper:
    """Make the paper's tables and figures, and the trade of speed for accuracy"""
    input:
        [
            file
            for table in tables
            if table.name in shipped.NAMES
            for file in table.files()
        ],
        targets.of_figures(experiments, wanted.narrowed),


every = [r.name for r in workflow.rules]
check.or_exit(check.named, files, check.check_free, experiments.scenes, every)
check.or_exit(results.check_folders, wanted.scenes, experiments.methods)
# Snakemake has a rule's output where its storage keeps it, if it is told of one.
check.or_exit(cluster.link, wanted.scenes, rules.config.output[0])


# What cannot be written to, or is held by another run. Jobs elsewhere write what this
# run's process has looked at.
onstart:
    if workflow.is_main_process:
        check.or_exit(results.check_writable, wanted.scenes, experiments.methods)
        check.or_exit(results.hold, *wanted.scenes)
        targets.tidy(wanted.scenes)
        check.or_exit(
            results.claim,
            wanted.scenes,
            targets.replaced(workflow.dag),
            targets.written(workflow.dag),
        )


# The last lines of a run: its tables, what is wrong with each scene, and what to do. Not
# those of a run before, where only its cost is asked for.
onsuccess:
    if "preview" not in workflow.dag_settings.targets:
        print(*check.or_exit(wanted.last_words, export_by), sep="\n")


# What stopped it comes after all that Snakemake says of it.
onerror:
    targets.say_in_the_end(targets.causes(log))


# One target for each scene that runs or is asked for, named like it. Beside a table it
# narrows the table.
for scene_name in wanted.scenes:

    rule:
        """Make this scene: tables, figures, verdict and page"""
        name:
            scene_name
        input:
            wanted.of_scene(scene_name),


check.or_exit(wanted.check, every)
