# Test views by cameras that are moved until they fit their photos, half by half.
rule align_test_poses:
    input:
        unpack(
            lambda w: layout.outputs_of(
                arguments.aligned_pose_inputs(experiment, w.scene, w.training)
            )
        ),
        model="results/{scene}/{training}/model.msgpack",
        depth="results/{scene}/{training}/depth",
        learnt="results/{scene}/{training}/learnt",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: inputs.decisions_of(experiment, w.scene),
    output:
        directory("results/{scene}/{training}/aligned_pose"),
    log:
        "results/{scene}/{training}/logs/align_test_poses.log",
    benchmark:
        "results/{scene}/{training}/logs/align_test_poses.tsv"
    conda:
        "../../environment.yml"
    threads: sources.OF_TRAINING
    resources:
        gpu=sources.ACCELERATORS,
        mem_mb=requests.memory_mb("{training}/render"),
        runtime=requests.minutes("{training}/metrics_aligned_pose.csv"),
    params:
        config=lambda w: experiment.training(w.scene, w.training).job.text,
        flows=lambda w: arguments.options(
            arguments.aligned_pose_inputs(experiment, w.scene, w.training)
        ),
        sources=sources_of("alignerf.align_test_poses"),
    shell:
        "python -m alignerf.align_test_poses --config {params.config:q}"
        " --scene results/{wildcards.scene:q} --model {input.model:q}"
        " --cameras {input.learnt:q}/cameras.npz --depth {input.depth:q}/test"
        " {params.flows:q} --out {output:q} --threads {threads} 2>&1 | tee {log:q}"


# Metrics per test view and test set; those by moved cameras are a file of their own.
rule evaluate:
    input:
        unpack(lambda w: inputs.of_scores(experiment, w.scene, w.training, w.moved)),
        # Another program's lie on the disk, also where results go to a storage.
        renders=lambda w: (
            local if inputs.is_given(experiment, w.training) else layout.output_of
        )(inputs.renders_of(experiment, w.scene, w.training, w.moved)),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        weights=lambda w: local([] if w.moved else list(config["lpips"].values())),
    output:
        "results/{scene}/{training}/metrics{moved}.csv",
    log:
        "results/{scene}/{training}/logs/evaluate{moved}.log",
    benchmark:
        "results/{scene}/{training}/logs/evaluate{moved}.tsv"
    wildcard_constraints:
        moved="|_aligned_pose",
    conda:
        "../../environment.yml"
    params:
        options=lambda w: inputs.scores_options(
            experiment, w.scene, w.training, w.moved
        ),
        sources=sources_of("alignerf.evaluate"),
    shell:
        "python -m alignerf.evaluate --scene results/{wildcards.scene:q}"
        " {params.options:q} --metrics {output:q} 2>&1 | tee {log:q}"
