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
        sources=sources_of("flow.decompose"),
    shell:
        "python -m flow.decompose --renders-depth {input.depth:q}"
        " --flow {input.flow:q} {params.model:q} --cameras {input.cameras:q}"
        " --split test --out-flow {output.parts:q} --stats-out {output.stats:q}"
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
