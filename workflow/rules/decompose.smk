# What the misalignment of the test views is made of: the camera's part, the rest and,
# where the truth is known, the model's own part.
rule decompose:
    input:
        depth="results/{scene}/{method}/round{round}/depth/test",
        flow="results/{scene}/{method}/round{round}/flow/test",
        cameras="results/{scene}/cameras.npz",
    output:
        parts=directory("results/{scene}/{method}/round{round}/parts/test"),
        stats="results/{scene}/{method}/round{round}/decomposition_test.csv",
    log:
        "results/{scene}/{method}/round{round}/logs/decompose.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/decompose.tsv"
    wildcard_constraints:
        scene=plan.one_of(experiment.with_truth(False)),
    conda:
        "../../environment.yml"
    params:
        model=[],
        split="test",
        sources=sources_of("flow.decompose"),
    shell:
        "python -m flow.decompose --renders-depth {input.depth:q}"
        " --flow {input.flow:q} {params.model:q} --cameras {input.cameras:q}"
        " --split {params.split} --out-flow {output.parts:q} --stats-out {output.stats:q}"
        " 2>&1 | tee {log:q}"


use rule decompose as decompose_courtyard with:
    input:
        renders="results/{scene}/{method}/round{round}/renders/test",
        truth="results/{scene}/truth",
        depth="results/{scene}/{method}/round{round}/depth/test",
        flow="results/{scene}/{method}/round{round}/flow/test",
        cameras="results/{scene}/cameras.npz",
    output:
        model=directory("results/{scene}/{method}/round{round}/flow_oracle/test"),
        model_stats="results/{scene}/{method}/round{round}/displacement_oracle.csv",
        parts=directory("results/{scene}/{method}/round{round}/parts/test"),
        stats="results/{scene}/{method}/round{round}/decomposition_test.csv",
    wildcard_constraints:
        scene=plan.one_of(experiment.with_truth(True)),
    params:
        model=lambda w, input, output: flows.of_oracle(experiment, input, output),


# The same as anybody's photos allow, who know no truth: for the verdict.
use rule decompose as decompose_photos with:
    input:
        depth="results/{scene}/{method}/round{round}/depth/{split}",
        flow="results/{scene}/{method}/round{round}/flow/{split}",
        cameras=lambda w: experiment.rendered_with(w.scene, w.method, w.round),
    output:
        parts=directory("results/{scene}/{method}/round{round}/parts_photos/{split}"),
        stats="results/{scene}/{method}/round{round}/decomposition_photos_{split}.csv",
    log:
        "results/{scene}/{method}/round{round}/logs/decompose_photos_{split}.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/decompose_photos_{split}.tsv"
    wildcard_constraints:
        scene=plan.one_of(experiment.scenes),
    params:
        split=lambda w: w.split,
