# Photos in, undistorted images and cameras out; the truth where it is known.
# Poses are computed once and kept: no later rule changes them.
rule poses:
    input:
        unpack(lambda w: inputs.of_poses(experiment, w.scene, local)),
    output:
        images=directory("results/{scene}/images"),
        cameras="results/{scene}/cameras.npz",
        report="results/{scene}/poses.json",
    log:
        "results/{scene}/logs/poses.log",
    benchmark:
        "results/{scene}/logs/poses.tsv"
    wildcard_constraints:
        scene=plan.one_of(experiment.with_truth(False)),
    conda:
        "../../environment.yml"
    threads: sources.WHOLE_MACHINE
    resources:
        mem_mb=requests.usual_mb,
    params:
        config=lambda w: plan.scene_config(experiment, w.scene),
        options=lambda w: inputs.poses_options(experiment, w.scene),
        sources=sources_of("alignerf.poses"),
    shell:
        "python -m alignerf.poses --config {params.config:q} {params.options:q}"
        " --out results/{wildcards.scene:q} 2>&1 | tee {log:q}"


use rule poses as poses_courtyard with:
    output:
        images=directory("results/{scene}/images"),
        truth=directory("results/{scene}/truth"),
        cameras="results/{scene}/cameras.npz",
        report="results/{scene}/poses.json",
    wildcard_constraints:
        scene=plan.one_of(experiment.with_truth(True)),


rule facts:
    input:
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        poses="results/{scene}/poses.json",
    output:
        "results/{scene}/facts.json",
    log:
        "results/{scene}/logs/facts.log",
    benchmark:
        "results/{scene}/logs/facts.tsv"
    conda:
        "../../environment.yml"
    params:
        sources=sources_of("alignerf.facts"),
    shell:
        "python -m alignerf.facts --scene results/{wildcards.scene:q}"
        " --facts {output:q} 2>&1 | tee {log:q}"


# Settings that the facts call for; jobs take those that the config leaves to them.
rule decisions:
    input:
        "results/{scene}/facts.json",
    output:
        "results/{scene}/decisions.json",
    log:
        "results/{scene}/logs/decisions.log",
    benchmark:
        "results/{scene}/logs/decisions.tsv"
    conda:
        "../../environment.yml"
    params:
        sources=sources_of("alignerf.decisions"),
    shell:
        "python -m alignerf.decisions --facts {input:q} --out {output:q} 2>&1"
        " | tee {log:q}"


# What the config and the defaults come to, beside the results that they made.
rule config:
    output:
        "results/{scene}/config.yaml",
    log:
        "results/{scene}/logs/config.log",
    benchmark:
        "results/{scene}/logs/config.tsv"
    conda:
        "../../environment.yml"
    params:
        config=lambda w: plan.complete_config(experiment, w.scene),
        sources=sources_of("alignerf.config"),
    shell:
        "python -m alignerf.config --config {params.config:q} --out {output:q}"
        " 2>&1 | tee {log:q}"
