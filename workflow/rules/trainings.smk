# Trainings and their renders. What each learns from, and what leads to it, is its
# `Training` (alignerf/experiment/trainings.py). Checkpoints, and models of other
# programs, lie outside of `output:`, which Snakemake deletes when a job is killed: a
# training resumes.
rule train:
    """Train one round of a method"""
    input:
        unpack(step.train.inputs),
    output:
        timing=training.timing,
        learnt=directory(training.learnt),
    log:
        training.log("train"),
    benchmark:
        training.benchmark("train")
    conda:
        "../../environment.yml"
    threads: step.train.threads
    resources:
        gpu=step.train.gpu,
        mem_mb=step.train.memory_mb,
        runtime=cluster.minutes,
    params:
        command=step.train.command,
        sources=step.train.sources,
    shell:
        "python -m {params.command:q} --threads {threads} --gpus {resources.gpu}"
        " --sources {params.sources} 2>&1 | tee {log:q}"


rule render:
    """Render the views of a trained round"""
    input:
        unpack(step.render.inputs),
    output:
        renders=directory(training.renders),
        depth=directory(training.depth),
        timing=directory(training.render),
    log:
        training.log("render"),
    benchmark:
        training.benchmark("render")
    conda:
        "../../environment.yml"
    threads: step.render.threads
    resources:
        gpu=step.render.gpu,
        mem_mb=step.render.memory_mb,
        runtime=cluster.minutes,
    params:
        command=step.render.command,
        sources=step.render.sources,
    shell:
        RUN_ON_DEVICES
