# Hours, memory and disk of a scene's whole plan, from a calibration of this machine,
# before all else that waits for the scene's cameras. It takes the machine as long, and
# what it compiles its trainings need not. No training has it as an input: measured
# anew, for another plan, it makes nothing again.
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
    priority: 100
    conda:
        "../../environment.yml"
    threads: sources.WHOLE_MACHINE
    resources:
        gpu=sources.ACCELERATORS,
        mem_mb=requests.usual_mb,
        of_training=sources.OF_TRAINING,
    params:
        work=lambda w: costs.as_json(experiment, w.scene),
    shell:
        "python -m alignerf.costs --scene results/{wildcards.scene:q}"
        " --work {params.work:q} --cores {threads} --threads {resources.of_training}"
        " --out {output:q} 2>&1 | tee {log:q}"


# What the facts decide and what all will cost, of all scenes, before any training.
rule preview:
    input:
        decisions=expand("results/{scene}/decisions.json", scene=experiment.captures()),
        costs=[targets.preflight_of(experiment, name) for name in experiment.captures()],
    log:
        "results/logs/preview.log",
    conda:
        "../../environment.yml"
    params:
        asked=[] if config["decide"] else ["--unasked"],
        sources=sources_of("alignerf.decisions", "alignerf.costs"),
    shell:
        "(python -m alignerf.decisions --show {input.decisions:q} {params.asked} &&"
        " python -m alignerf.costs --show {input.costs:q}) 2>&1 | tee {log:q}"
