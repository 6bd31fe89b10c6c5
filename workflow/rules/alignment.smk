# Optical flow from render to photo, and the photos warped onto the renders. Always
# from the original photo, so that nothing compounds over the rounds.
rule align:
    input:
        renders="results/{scene}/{training}/renders",
        depth="results/{scene}/{training}/depth",
        photos="results/{scene}/images",
    output:
        flow=directory("results/{scene}/{training}/flow"),
        warped=directory("results/{scene}/{training}/warped"),
        stats=directory("results/{scene}/{training}/displacement"),
    log:
        "results/{scene}/{training}/logs/align.log",
    benchmark:
        "results/{scene}/{training}/logs/align.tsv"
    conda:
        "../../environment.yml"
    threads: lambda w: inputs.threads_of_views(experiment, w.scene)
    params:
        flow=lambda w: arguments.of_training_views(experiment, w.scene, w.training),
        splits=lambda w: experiment.splits(w.scene, w.training),
        sources=sources_of("flow.align"),
    shell:
        "python -m flow.align {params.flow:q} --splits {params.splits}"
        " --threads {threads} --renders {input.renders:q}/{{split}} --depth {input.depth:q}/{{split}}"
        " --photos {input.photos:q} --masks {input.photos:q}/masks"
        " --flow-out {output.flow:q}/{{split}} --warped-out {output.warped:q}/{{split}}"
        " --stats-out {output.stats:q}/{{split}}.csv 2>&1 | tee {log:q}"


# The warped test set: made once, by the reference model, for all methods.
rule testset:
    input:
        renders=lambda w: f"{experiment.reference_folder(w.scene)}/renders",
        depth=lambda w: f"{experiment.reference_folder(w.scene)}/depth",
        photos="results/{scene}/images",
    output:
        flow=directory("results/{scene}/testset/flow"),
        warped=directory("results/{scene}/testset/warped"),
        stats="results/{scene}/testset/displacement.csv",
    log:
        "results/{scene}/testset/logs/align.log",
    benchmark:
        "results/{scene}/testset/logs/align.tsv"
    conda:
        "../../environment.yml"
    params:
        flow=lambda w: arguments.of_reference(experiment, w.scene),
        sources=sources_of("flow.align"),
    shell:
        "python -m flow.align {params.flow:q} --renders {input.renders:q}/test"
        " --depth {input.depth:q}/test"
        " --photos {input.photos:q} --masks {input.photos:q}/masks"
        " --flow-out {output.flow:q}"
        " --warped-out {output.warped:q} --stats-out {output.stats:q}"
        " 2>&1 | tee {log:q}"


# Beside it, what of its gain is not alignment.
rule control_sets:
    input:
        unpack(lambda w: inputs.truth_of(experiment, w.scene)),
        renders=lambda w: f"{experiment.reference_folder(w.scene)}/renders",
        photos="results/{scene}/images",
        flow="results/{scene}/testset/flow",
    output:
        [
            directory(f"results/{{scene}}/testset/{name}")
            for name in inputs.testsets.image_folders()
        ],
        lengths="results/{scene}/testset/overfit.csv",
    log:
        "results/{scene}/testset/logs/control_sets.log",
    benchmark:
        "results/{scene}/testset/logs/control_sets.tsv"
    conda:
        "../../environment.yml"
    params:
        flow=arguments.estimator_options(experiment),
        truth=lambda w, input: arguments.option("truth", input.get("truth")),
        sources=sources_of("flow.control_sets"),
    shell:
        "python -m flow.control_sets {params.flow:q} --renders {input.renders:q}/test"
        " --photos {input.photos:q} --masks {input.photos:q}/masks"
        " --flow {input.flow:q} {params.truth:q}"
        " --out results/{wildcards.scene:q}/testset 2>&1 | tee {log:q}"


# With `rounds: auto`: whether another round follows, and why.
checkpoint decide:
    input:
        unpack(
            lambda w: layout.outputs_of(
                arguments.of_rounds(experiment, w.scene, w.method, w.round)
            )
        ),
    output:
        "results/{scene}/{method}/round{round}/decision.json",
    log:
        "results/{scene}/{method}/round{round}/logs/decide.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/decide.tsv"
    conda:
        "../../environment.yml"
    params:
        options=lambda w: arguments.options(
            arguments.of_rounds(experiment, w.scene, w.method, w.round)
        ),
        sources=sources_of("flow.rounds"),
    shell:
        "python -m flow.rounds {params.options:q} --out {output:q} 2>&1 | tee {log:q}"


# Cameras of a training, put right by what their motion explains of its flow.
rule correct_poses:
    input:
        unpack(lambda w: inputs.truth_of(experiment, w.scene)),
        flow="results/{scene}/{training}/flow",
        depth="results/{scene}/{training}/depth",
        learnt="results/{scene}/{training}/learnt",
        cameras="results/{scene}/cameras.npz",
    output:
        cameras="results/{scene}/{training}/corrected/cameras.npz",
        report="results/{scene}/{training}/corrected/poses_corrected.json",
    log:
        "results/{scene}/{training}/logs/correct_poses.log",
    benchmark:
        "results/{scene}/{training}/logs/correct_poses.tsv"
    conda:
        "../../environment.yml"
    threads: sources.WHOLE_MACHINE
    params:
        truth=lambda w: arguments.options(inputs.truth_of(experiment, w.scene)),
        sources=sources_of("alignerf.correct_poses"),
    shell:
        "python -m alignerf.correct_poses --scene results/{wildcards.scene:q}"
        " --cameras {input.learnt:q}/cameras.npz --flow {input.flow:q}/train"
        " --depth {input.depth:q}/train {params.truth:q} --out {output.cameras:q}"
        " --report {output.report:q} --threads {threads} 2>&1 | tee {log:q}"
