# Why a NeRF or a splat is blurry, and AligNeRF (CVPR 2023): from photos to tables.
#
#   snakemake --cores N                    make every scene of the default config
#   snakemake --cores N courtyard          make one scene
#   snakemake --cores N preview            print what it will cost, before any training
#   snakemake --cores N export             write cameras and photos for other programs
#   snakemake --cores N comparison         compare all methods: Tables 2 and 3
#   snakemake --cores N regimes            show when each part of AligNeRF pays
#   snakemake --cores N remedies           compare all fixes at equal training time
#   snakemake --cores N tradeoff           compare what settings cost and bring
#   snakemake --cores N download_360_v2    download the paper's scenes (17 GB)
# All targets: snakemake --list-target-rules. All rules: snakemake --list.
# Another config, after the target, since --configfile takes all words that follow:
#   snakemake --cores N export --configfile workflow/config/own_photos.yaml
# profiles/default holds the options that every command has.
import gc
import sys

sys.path.insert(0, workflow.basedir)

from snakemake.cli import get_argument_parser
from snakemake.utils import min_version

from alignerf.costs import plan as costs
from alignerf.costs import requests
from alignerf.experiment import check, cluster, layout, plan, sources, steps, targets
from alignerf.experiment.checks import fetched, results
from alignerf.experiment.tables import scenes

min_version("9.0")
# A plan's jobs live until its end: of a large one, a sixth of the time goes into looking
# for garbage among them (docs/measured/planning.csv).
gc.set_threshold(1_000_000)


# Not merged with a config of the user's: that one differs from the defaults, not from
# the demo.
if not workflow.overwrite_configfiles:

    configfile: workflow.source_path("workflow/config/demo.yaml")


files = workflow.overwrite_configfiles
config = check.or_exit(check.checked, config, files)
# Whether a method with `rounds: auto` goes on is known once rule `decide` has run.
experiment = plan.Experiment(
    config,
    lambda **place: plan.goes_on(
        cluster.here(checkpoints.decide.get(**place).output[0])
    ),
)
check.or_exit(check.named, files, plan.check_equal, experiment)
export_by = targets.export_command(workflow.overwrite_configfiles)
sources.set_environment(experiment.captures(), export_by)

# Of the rules: their jobs, patterns of their paths, and what they run.
step = steps.Rules(experiment, local, requests)
scene, training = layout.Scene("{scene}"), layout.training("{scene}", "{training}")
RUN = "python -m {params.command:q} 2>&1 | tee {log:q}"
RUN_IN_THREADS = "python -m {params.command:q} --threads {threads} 2>&1 | tee {log:q}"


report: "workflow/report/workflow.rst"


wildcard_constraints:
    scene=plan.one_of(experiment.scenes),
    method=plan.one_of(experiment.methods),
    training=plan.folders(experiment),
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
        [targets.of_scene(experiment, name) for name in experiment.captures()],


every = [r.name for r in workflow.rules]
check.or_exit(check.named, files, check.check_free, experiment.scenes, every)
check.or_exit(results.check_folders, experiment.scenes, experiment.methods)
# Snakemake has a rule's output where its storage keeps it, if it is told of one.
check.or_exit(cluster.link, experiment.scenes, rules.config.output[0])


# What cannot be written to, and what a killed run has half written.
onstart:
    check.or_exit(results.check_writable, experiment.scenes, experiment.methods)
    targets.tidy(experiment.scenes)
    check.or_exit(
        results.claim, experiment.scenes, targets.replaced(experiment, workflow.dag)
    )


# The last lines of a run: what is wrong with each scene, and what to do. Not those of a
# run before, where only its cost is asked for.
onsuccess:
    if "preview" not in workflow.dag_settings.targets:
        told = experiment.captures(), export_by * targets.can_export(experiment)
        print(*check.or_exit(targets.verdicts, *told), sep="\n")


# What stopped it comes after all that Snakemake says of it.
onerror:
    targets.say_in_the_end(targets.causes(log))


# One target for each scene, named like it.
for scene_name in experiment.scenes:

    rule:
        """Make this scene: tables, figures, verdict and page"""
        name:
            scene_name
        input:
            targets.of_scene(experiment, scene_name),


# Snakemake has its targets only once this file is read; they are in its command line.
if workflow.is_main_process and "snakemake" in sys.argv[0].split("/")[-2:]:
    asked, _ = get_argument_parser().parse_known_args()
    check.or_exit(targets.check_asked, asked.targets, experiment.scenes, every)
