# What the misalignment of views is made of: the camera's part and the rest. Of test views
# for the tables, and for the verdict as anybody's photos allow, who know no truth: by
# the cameras of the renders, of all views that are aligned (`_photos`).
rule decompose:
    input:
        depth="results/{scene}/{training}/depth",
        flow="results/{scene}/{training}/flow",
        learnt="results/{scene}/{training}/learnt",
        cameras="results/{scene}/cameras.npz",
    output:
        parts=directory("results/{scene}/{training}/parts{photos}/{split}"),
        stats="results/{scene}/{training}/decomposition{photos}_{split}.csv",
    log:
        "results/{scene}/{training}/logs/decompose{photos}_{split}.log",
    benchmark:
        "results/{scene}/{training}/logs/decompose{photos}_{split}.tsv"
    wildcard_constraints:
        photos="|_photos",
    conda:
        "../../environment.yml"
    threads: lambda w: inputs.threads_of_views(experiment, w.scene)
    params:
        model=[],
        split=lambda w: w.split,
        cameras=lambda w, input: (
            f"{input.learnt}/cameras.npz" if w.photos else input.cameras
        ),
        sources=sources_of("flow.decompose"),
    shell:
        "python -m flow.decompose --renders-depth {input.depth:q}/{params.split}"
        " --flow {input.flow:q}/{params.split} {params.model:q}"
        " --cameras {params.cameras:q} --split {params.split} --threads {threads}"
        " --out-flow {output.parts:q} --stats-out {output.stats:q} 2>&1 | tee {log:q}"


# Where the truth is known, the model's own part is taken off first.
use rule decompose as decompose_courtyard with:
    input:
        renders="results/{scene}/{training}/renders",
        truth="results/{scene}/truth",
        depth="results/{scene}/{training}/depth",
        flow="results/{scene}/{training}/flow",
        cameras="results/{scene}/cameras.npz",
    output:
        model=directory("results/{scene}/{training}/flow_oracle/test"),
        model_stats="results/{scene}/{training}/displacement_oracle.csv",
        parts=directory("results/{scene}/{training}/parts/test"),
        stats="results/{scene}/{training}/decomposition_test.csv",
    log:
        "results/{scene}/{training}/logs/decompose.log",
    benchmark:
        "results/{scene}/{training}/logs/decompose.tsv"
    wildcard_constraints:
        scene=plan.one_of(experiment.with_truth(True)),
    params:
        model=lambda w, input, output: arguments.of_oracle(experiment, input, output),
        split="test",
        cameras=lambda w, input: input.cameras,


ruleorder: decompose_courtyard > decompose
