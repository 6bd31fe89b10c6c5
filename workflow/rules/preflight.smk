# Before all else that waits for the scene's cameras. It takes the machine as long, and
# what it compiles its trainings need not. No training has it as an input: measured
# anew, for another plan, it makes nothing again.
rule preflight:
    """Time a step of each training and estimate a scene's minutes and memory"""
    input:
        unpack(step.preflight.inputs),
    output:
        scene.preflight,
    log:
        scene.log("preflight"),
    benchmark:
        scene.benchmark("preflight")
    priority: 100
    conda:
        "../../environment.yml"
    threads: step.preflight.threads
    resources:
        gpu=step.preflight.gpu,
        mem_mb=cluster.usual_mb,
        of_training=sources.OF_TRAINING,
    params:
        command=step.preflight.command,
        work=lambda w: costs.as_json(experiments.of(w.scene), w.scene),
    shell:
        "python -m {params.command:q} --work {params.work:q} --cores {threads}"
        " --threads {resources.of_training} --gpus {resources.gpu} 2>&1 | tee {log:q}"


# What the facts decide and what all will cost, of all scenes, before any training.
rule preview:
    """Print what every scene will cost, before any training"""
    input:
        decisions=[layout.Scene(name).decisions for name in experiments.captures()],
        costs=[
            targets.preflight_of(experiments.of(name), name)
            for name in experiments.captures()
        ],
    log:
        "results/logs/preview.log",
    conda:
        "../../environment.yml"
    params:
        asked=targets.unasked(experiments),
        sources=sources.sources_of("alignerf.facts", "alignerf.costs"),
    shell:
        "(python -m alignerf.facts --show {input.decisions:q} {params.asked} &&"
        " python -m alignerf.costs --show {input.costs:q}) 2>&1 | tee {log:q}"
