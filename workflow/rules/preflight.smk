# Hours, memory and disk of a scene's whole plan, from a calibration of this machine.
# It takes the machine as long, and what it compiles its trainings need not. With
# `preflight: false` the file says nothing: it is there even so, since a training whose
# inputs are others than before is made again.
rule preflight:
    input:
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
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
    params:
        work=lambda w: slices.as_json(targets.work(experiment, w.scene)),
        of_training=sources.OF_TRAINING,
        sources=sources_of("alignerf.preflight"),
    shell:
        "python -m alignerf.preflight --scene results/{wildcards.scene:q}"
        " --work {params.work:q} --cores {threads} --threads {params.of_training}"
        " --out {output:q} 2>&1 | tee {log:q}"


# Of all scenes, before any training.
rule preview:
    input:
        expand("results/{scene}/preflight.json", scene=experiment.scenes),
    log:
        "results/logs/preview.log",
    conda:
        "../../environment.yml"
    params:
        sources=sources_of("alignerf.preflight"),
    shell:
        "python -m alignerf.preflight --show {input:q} 2>&1 | tee {log:q}"
