# Hours, memory and disk of a scene's whole plan, from a calibration of this machine.
# It takes the machine as long, and what it compiles its trainings need not. With
# `preflight: false` the file says nothing: it is there even so, since a training whose
# inputs are others than before is made again. For another config it is measured again
# by `preview` alone (see sources.Unnoted). Made anew by force, or since somebody deleted
# the file, it would have all trainings of its scene made again.
rule preflight:
    input:
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: inputs.decisions_of(experiment, w.scene),
    output:
        "results/{scene}/preflight.json",
    log:
        "results/{scene}/logs/preflight.log",
    benchmark:
        "results/{scene}/logs/preflight.tsv"
    conda:
        "../../environment.yml"
    threads: sources.WHOLE_MACHINE
    resources:
        gpu=sources.ACCELERATORS,
        mem_mb=needs.usual_mb,
        of_training=sources.OF_TRAINING,
    params:
        work=lambda w: sources.Unnoted(work.as_json(experiment, w.scene)),
    shell:
        "python -m alignerf.preflight --scene results/{wildcards.scene:q}"
        " --work {params.work:q} --cores {threads} --threads {resources.of_training}"
        " --out {output:q} 2>&1 | tee {log:q}"


# What the facts decide and what all will cost, of all scenes, before any training.
rule preview:
    input:
        decisions=expand("results/{scene}/decisions.json", scene=experiment.captures()),
        costs=expand("results/{scene}/preflight.json", scene=experiment.captures()),
        configs=expand("results/{scene}/config.yaml", scene=experiment.captures()),
    log:
        "results/logs/preview.log",
    conda:
        "../../environment.yml"
    threads: sources.WHOLE_MACHINE
    resources:
        gpu=sources.ACCELERATORS,
        mem_mb=needs.usual_mb,
        runtime=lambda w, attempt: 30 * len(experiment.captures()) * 2 ** (attempt - 1),
        of_training=sources.OF_TRAINING,
    params:
        asked=[] if config["decide"] else ["--unasked"],
        sources=sources_of("alignerf.decisions", "alignerf.preflight"),
    shell:
        "(python -m alignerf.decisions --show {input.decisions:q} {params.asked} &&"
        " python -m alignerf.preflight --show {input.costs:q} --configs {input.configs:q}"
        " --cores {threads} --threads {resources.of_training}) 2>&1 | tee {log:q}"
