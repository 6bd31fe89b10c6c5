# Test views by cameras that are moved until they fit their photos, half by half.
rule align_test_poses:
    input:
        unpack(
            lambda w: flows.aligned_pose_inputs(experiment, w.scene, w.method, w.round)
        ),
        model="results/{scene}/{method}/round{round}/model.msgpack",
        depth="results/{scene}/{method}/round{round}/depth/test",
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: rows.decisions_of(experiment, w.scene),
        used=lambda w: experiment.rendered_with(w.scene, w.method, w.round),
    output:
        directory("results/{scene}/{method}/round{round}/aligned_pose"),
    log:
        "results/{scene}/{method}/round{round}/logs/align_test_poses.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/align_test_poses.tsv"
    conda:
        "../../environment.yml"
    threads: sources.OF_TRAINING
    resources:
        gpu=sources.ACCELERATORS,
        mem_mb=needs.memory_mb(costs, "{method}/round{round}/render_test.json"),
        runtime=needs.minutes(costs, "{method}/round{round}/metrics_aligned_pose.csv"),
    params:
        config=lambda w: slices.of_round(experiment, w.scene, w.method),
        fits=lambda w, input: flows.aligned_pose_options(experiment, input),
        sources=sources_of("alignerf.align_test_poses"),
    shell:
        "python -m alignerf.align_test_poses --config {params.config:q}"
        " --scene results/{wildcards.scene:q} --model {input.model:q}"
        " --cameras {input.used:q} --depth {input.depth:q} {params.fits:q}"
        " --out {output:q} --threads {threads} 2>&1 | tee {log:q}"


# Metrics per test view and test set.
rule evaluate:
    input:
        unpack(lambda w: rows.truth_of(experiment, w.scene)),
        # Another program's lie on the disk, also where results go to a storage.
        renders=lambda w: (local if w.method in experiment.given() else str)(
            rows.renders_of(experiment, w.scene, w.method, w.round)
        ),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        flow="results/{scene}/testset/flow",
        warped="results/{scene}/testset/warped",
        controls=[f"results/{{scene}}/testset/{name}" for name in flows.CONTROL_SETS],
        weights=local(list(config["lpips"].values())),
    output:
        "results/{scene}/{method}/round{round}/metrics.csv",
    log:
        "results/{scene}/{method}/round{round}/logs/evaluate.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/evaluate.tsv"
    conda:
        "../../environment.yml"
    params:
        testset=lambda w: flows.option("testset", f"results/{w.scene}/testset"),
        truth=lambda w, input: flows.option("truth", input.get("truth")),
        renders=lambda w, input: flows.option("renders", input.renders),
        lpips=flows.lpips_options(experiment),
        sources=sources_of("alignerf.evaluate"),
    shell:
        "python -m alignerf.evaluate --scene results/{wildcards.scene:q}"
        " {params.renders:q} {params.testset:q} {params.truth:q}"
        " {params.lpips:q} --metrics {output:q} 2>&1 | tee {log:q}"


# Of those by moved cameras.
use rule evaluate as evaluate_aligned_pose with:
    input:
        unpack(lambda w: rows.truth_of(experiment, w.scene)),
        renders="results/{scene}/{method}/round{round}/aligned_pose",
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
    output:
        "results/{scene}/{method}/round{round}/metrics_aligned_pose.csv",
    log:
        "results/{scene}/{method}/round{round}/logs/evaluate_aligned_pose.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/evaluate_aligned_pose.tsv"
    params:
        renders=lambda w, input: flows.option("aligned-pose", input.renders),
        testset=[],
        # Of these renders PSNR alone is scored.
        lpips=[],
