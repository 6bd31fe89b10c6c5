# The misalignment analysis of AligNeRF (CVPR 2023), from photos to tables.
#
#   snakemake --cores N                    everything of the default config
#   snakemake --cores N courtyard          one scene of the config
#   snakemake --cores N tradeoff           what settings cost, and what they bring
#   snakemake --cores N regimes            when each part of AligNeRF pays
#   snakemake --cores N flow_benchmark     how right and how fast the flow estimators are
#   snakemake --cores N --configfile workflow/config/own_photos.yaml
from snakemake.utils import min_version

min_version("9.0")


# Not merged with a config of the user's: that one must be complete, or stop.
if not workflow.overwrite_configfiles:

    configfile: workflow.source_path("workflow/config/demo.yaml")


include: "workflow/rules/config.smk"


check_config(config)


include: "workflow/rules/common.smk"
include: "workflow/rules/flow.smk"
include: "workflow/rules/rows.smk"
include: "workflow/rules/sweep.smk"
include: "workflow/rules/regime_rows.smk"
include: "workflow/rules/targets.smk"


wildcard_constraints:
    scene=one_of(config["scenes"]),
    method=one_of(config["methods"]),
    variant=one_of(
        ["base", *config["tradeoff"]["variants"]] if "tradeoff" in config else []
    ),
    round=r"0|[1-9]\d*",
    split="train|test",


include: "workflow/rules/poses.smk"
include: "workflow/rules/train.smk"
include: "workflow/rules/alignment.smk"
include: "workflow/rules/decompose.smk"
include: "workflow/rules/evaluate.smk"
include: "workflow/rules/tables.smk"
include: "workflow/rules/tradeoff.smk"
include: "workflow/rules/regimes.smk"
include: "workflow/rules/flow_benchmark.smk"


rule all:
    default_target: True
    input:
        [scene_targets(name) for name in config["scenes"]],


# One target for each scene, named like it.
for scene_name in config["scenes"]:

    rule:
        name:
            scene_name
        input:
            scene_targets(scene_name),
