# Trainings and their renders. What each learns from, and what leads to it, is its
# `Training` (alignerf/experiment/trainings.py). Checkpoints lie outside of `output:`,
# which Snakemake deletes when a job is killed: a training resumes.
rule train:
    input:
        unpack(lambda w: inputs.of_training(experiment, w.scene, w.training)),
        weights=lambda w: local(inputs.weights_of(experiment, w.scene, w.training)),
    output:
        model="results/{scene}/{training}/model.msgpack",
        timing="results/{scene}/{training}/timing.json",
        learnt=directory("results/{scene}/{training}/learnt"),
    log:
        "results/{scene}/{training}/logs/train.log",
    benchmark:
        "results/{scene}/{training}/logs/train.tsv"
    wildcard_constraints:
        training=plan.trained_by(experiment, external=False),
    conda:
        "../../environment.yml"
    threads: sources.OF_TRAINING
    resources:
        gpu=sources.ACCELERATORS,
        launcher="",
        mem_mb=requests.memory_mb("{training}/timing.json"),
        runtime=requests.minutes("{training}/timing.json"),
    params:
        config=lambda w: experiment.training(w.scene, w.training).job.text,
        options=lambda w: inputs.training_options(experiment, w.scene, w.training),
        checkpoints=subpath(output.model, parent=True),
        sources=lambda w: sources_of(*experiment.training(w.scene, w.training).modules),
    shell:
        "{resources.launcher} python -m alignerf.train --config {params.config:q}"
        " {params.options:q} --checkpoints {params.checkpoints:q}/checkpoints"
        " --sources {params.sources} --model {output.model:q} --learnt {output.learnt:q}"
        " --timing {output.timing:q} --threads {threads} 2>&1 | tee {log:q}"


# Test views; training views where their flow is asked for, after a pre-training alone.
rule render:
    input:
        model="results/{scene}/{training}/model.msgpack",
        learnt="results/{scene}/{training}/learnt",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: inputs.decisions_of(experiment, w.scene),
    output:
        renders=directory("results/{scene}/{training}/renders"),
        depth=directory("results/{scene}/{training}/depth"),
        timing=directory("results/{scene}/{training}/render"),
    log:
        "results/{scene}/{training}/logs/render.log",
    benchmark:
        "results/{scene}/{training}/logs/render.tsv"
    wildcard_constraints:
        training=plan.trained_by(experiment, external=False),
    conda:
        "../../environment.yml"
    threads: sources.OF_TRAINING
    resources:
        gpu=sources.ACCELERATORS,
        mem_mb=requests.memory_mb("{training}/render"),
        runtime=requests.minutes("{training}/render"),
    params:
        config=lambda w: experiment.training(w.scene, w.training).job.text,
        splits=lambda w: experiment.splits(w.scene, w.training),
        sources=sources_of("alignerf.render_views"),
    shell:
        "python -m alignerf.render_views --config {params.config:q}"
        " --scene results/{wildcards.scene:q} --model {input.model:q}"
        " --cameras {input.learnt:q}/cameras.npz --splits {params.splits}"
        " --renders {output.renders:q}/{{split}} --depth {output.depth:q}/{{split}}"
        " --timing {output.timing:q}/{{split}}.json --threads {threads} 2>&1"
        " | tee {log:q}"
