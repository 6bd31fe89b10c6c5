# Trainings of methods that are `external`, and their renders: another program's commands
# do what rules `train` and `render` do of ours. Its models lie outside of `output:`, as
# our checkpoints do: a program that can resume finds them.
rule external_data:
    input:
        unpack(lambda w: inputs.of_external(experiment, w.scene, w.training)),
    output:
        directory("results/{scene}/{training}/data"),
    log:
        "results/{scene}/{training}/logs/external_data.log",
    benchmark:
        "results/{scene}/{training}/logs/external_data.tsv"
    wildcard_constraints:
        scene=plan.one_of(experiment.judged(False)),
        training=plan.trained_by(experiment, external=True),
    conda:
        "../../environment.yml"
    threads: sources.OF_TRAINING
    params:
        options=lambda w: inputs.external_options(experiment, w.scene, w.training),
        sources=sources_of("alignerf.others.data"),
    shell:
        "python -m alignerf.others.data --scene results/{wildcards.scene:q}"
        " {params.options:q} --out {output:q} 2>&1 | tee {log:q}"


rule external_train:
    input:
        data=lambda w: inputs.external_data(experiment, w.scene, w.training),
        cameras=lambda w: layout.output_of(
            experiment.training(w.scene, w.training).cameras
        ),
    output:
        timing="results/{scene}/{training}/timing.json",
        learnt=directory("results/{scene}/{training}/learnt"),
    log:
        "results/{scene}/{training}/logs/train.log",
    benchmark:
        "results/{scene}/{training}/logs/train.tsv"
    wildcard_constraints:
        scene=plan.one_of(experiment.judged(False)),
        training=plan.trained_by(experiment, external=True),
    conda:
        "../../environment.yml"
    threads: sources.OF_TRAINING
    resources:
        gpu=lambda w: inputs.external_keys(experiment, w.training)["gpu"],
        mem_mb=lambda w, attempt: (
            inputs.external_keys(experiment, w.training)["mem_mb"]
            or requests.usual_mb(w, attempt)
        ),
        runtime=requests.minutes("{training}/timing.json"),
    params:
        config=lambda w: experiment.training(w.scene, w.training).job.text,
        cameras=lambda w: experiment.training(w.scene, w.training).cameras,
        folder=subpath(output.timing, parent=True),
        sources=sources_of("alignerf.others.train"),
    shell:
        "python -m alignerf.others.train --config {params.config:q}"
        " --scene results/{wildcards.scene:q} --training {params.folder:q}"
        " --data {params.folder:q}/data --model {params.folder:q}/model"
        " --cores {threads} --cameras {params.cameras:q} --learnt {output.learnt:q}"
        " --timing {output.timing:q} 2>&1 | tee {log:q}"


rule external_render:
    input:
        data=lambda w: inputs.external_data(experiment, w.scene, w.training),
        timing="results/{scene}/{training}/timing.json",
        learnt="results/{scene}/{training}/learnt",
        cameras="results/{scene}/cameras.npz",
        finished=lambda w: local(
            inputs.external_folders(experiment, w.scene, w.training)
        ),
    output:
        renders=directory("results/{scene}/{training}/renders"),
        depth=directory("results/{scene}/{training}/depth"),
        timing=directory("results/{scene}/{training}/render"),
    log:
        "results/{scene}/{training}/logs/render.log",
    benchmark:
        "results/{scene}/{training}/logs/render.tsv"
    wildcard_constraints:
        scene=plan.one_of(experiment.judged(False)),
        training=plan.trained_by(experiment, external=True),
    conda:
        "../../environment.yml"
    threads: sources.OF_TRAINING
    resources:
        gpu=lambda w: inputs.external_keys(experiment, w.training)["gpu"],
        mem_mb=lambda w, attempt: (
            inputs.external_keys(experiment, w.training)["mem_mb"]
            or requests.usual_mb(w, attempt)
        ),
        runtime=requests.minutes("{training}/render"),
    params:
        config=lambda w: experiment.training(w.scene, w.training).job.text,
        splits=lambda w: experiment.splits(w.scene, w.training),
        folder=subpath(input.timing, parent=True),
        sources=sources_of("alignerf.others.render"),
    shell:
        "python -m alignerf.others.render --config {params.config:q}"
        " --scene results/{wildcards.scene:q} --training {params.folder:q}"
        " --data {params.folder:q}/data --model {params.folder:q}/model"
        " --cores {threads} --cameras {input.learnt:q}/cameras.npz"
        " --splits {params.splits}"
        " --renders {output.renders:q}/{{split}} --depth {output.depth:q}/{{split}}"
        " --timing {output.timing:q}/{{split}}.json 2>&1 | tee {log:q}"
