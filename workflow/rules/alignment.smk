# Optical flow from render to photo, and the photos warped onto the renders. Always
# from the original photo, so that nothing compounds over the rounds.
rule align:
    input:
        renders="results/{scene}/{method}/round{round}/renders/test",
        depth="results/{scene}/{method}/round{round}/depth/test",
        photos="results/{scene}/images",
    output:
        flow=directory("results/{scene}/{method}/round{round}/flow/test"),
        warped=directory("results/{scene}/{method}/round{round}/warped/test"),
        stats="results/{scene}/{method}/round{round}/displacement_test.csv",
    log:
        "results/{scene}/{method}/round{round}/logs/align.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/align.tsv"
    wildcard_constraints:
        method=plan.at_rounds(experiment.followed(), others=True),
    conda:
        "../../environment.yml"
    params:
        flow=lambda w: flows.of_views(experiment, w.scene, w.method, w.round),
        splits=["test"],
        folder=subpath(output.stats, parent=True),
        sources=sources_of("flow.align"),
    shell:
        "python -m flow.align {params.flow:q} --splits {params.splits}"
        " --renders {params.folder:q}/renders/{{split}}"
        " --depth {params.folder:q}/depth/{{split}} --photos {input.photos:q}"
        " --masks {input.photos:q}/masks"
        " --flow-out {params.folder:q}/flow/{{split}}"
        " --warped-out {params.folder:q}/warped/{{split}}"
        " --stats-out {params.folder:q}/displacement_{{split}}.csv 2>&1 | tee {log:q}"


use rule align as align_all with:
    input:
        train_renders="results/{scene}/{method}/round{round}/renders/train",
        train_depth="results/{scene}/{method}/round{round}/depth/train",
        renders="results/{scene}/{method}/round{round}/renders/test",
        depth="results/{scene}/{method}/round{round}/depth/test",
        photos="results/{scene}/images",
    output:
        train_flow=directory("results/{scene}/{method}/round{round}/flow/train"),
        train_warped=directory("results/{scene}/{method}/round{round}/warped/train"),
        train_stats="results/{scene}/{method}/round{round}/displacement_train.csv",
        flow=directory("results/{scene}/{method}/round{round}/flow/test"),
        warped=directory("results/{scene}/{method}/round{round}/warped/test"),
        stats="results/{scene}/{method}/round{round}/displacement_test.csv",
    wildcard_constraints:
        method=plan.at_rounds(experiment.followed()),
    params:
        splits=["train", "test"],


# The warped test set: made once, by the reference model, for all methods.
rule testset:
    input:
        renders=lambda w: f"{experiment.reference_folder(w.scene)}/renders/test",
        depth=lambda w: f"{experiment.reference_folder(w.scene)}/depth/test",
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
        flow=lambda w: flows.of_reference(experiment, w.scene),
        sources=sources_of("flow.align"),
    shell:
        "python -m flow.align {params.flow:q} --renders {input.renders:q}"
        " --depth {input.depth:q}"
        " --photos {input.photos:q} --masks {input.photos:q}/masks"
        " --flow-out {output.flow:q}"
        " --warped-out {output.warped:q} --stats-out {output.stats:q}"
        " 2>&1 | tee {log:q}"


# Beside it, what of its gain is not alignment.
rule control_sets:
    input:
        unpack(lambda w: rows.truth_of(experiment, w.scene)),
        renders=lambda w: f"{experiment.reference_folder(w.scene)}/renders/test",
        photos="results/{scene}/images",
        flow="results/{scene}/testset/flow",
    output:
        [directory(f"results/{{scene}}/testset/{name}") for name in flows.CONTROL_SETS],
        lengths="results/{scene}/testset/leak.csv",
    log:
        "results/{scene}/testset/logs/control_sets.log",
    benchmark:
        "results/{scene}/testset/logs/control_sets.tsv"
    conda:
        "../../environment.yml"
    params:
        flow=flows.estimator_options(experiment),
        truth=lambda w, input: flows.option("truth", input.get("truth")),
        sources=sources_of("flow.control_sets"),
    shell:
        "python -m flow.control_sets {params.flow:q} --renders {input.renders:q}"
        " --photos {input.photos:q} --masks {input.photos:q}/masks"
        " --flow {input.flow:q} {params.truth:q}"
        " --out results/{wildcards.scene:q}/testset 2>&1 | tee {log:q}"


# With `rounds: auto`: whether another round follows, and why.
checkpoint decide:
    input:
        unpack(lambda w: flows.of_rounds(experiment, w.scene, w.method, w.round)),
    output:
        "results/{scene}/{method}/round{round}/decision.json",
    log:
        "results/{scene}/{method}/round{round}/logs/decide.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/decide.tsv"
    conda:
        "../../environment.yml"
    params:
        found=lambda w, input: [
            part
            for name in ("flow", "before_flow", "corrections")
            for part in flows.option(name.replace("_", "-"), input.get(name))
        ],
        before=lambda w, input: flows.option("before", input.get("before")),
        sources=sources_of("flow.rounds"),
    shell:
        "python -m flow.rounds {params.found:q}"
        " {params.before:q} --out {output:q} 2>&1 | tee {log:q}"


# Cameras instead of photos: for the next round they are put right by what their motion
# explains of the flow.
rule correct_poses:
    input:
        unpack(lambda w: rows.truth_of(experiment, w.scene)),
        flow=lambda w: flows.before(experiment, w, "flow/train"),
        depth=lambda w: flows.before(experiment, w, "depth/train"),
        used=lambda w: experiment.cameras_of(w.scene, w.method, int(w.round) - 1),
        cameras="results/{scene}/cameras.npz",
    output:
        cameras="results/{scene}/{method}/round{round}/corrected/cameras.npz",
        report="results/{scene}/{method}/round{round}/corrected/poses_corrected.json",
    log:
        "results/{scene}/{method}/round{round}/logs/correct_poses.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/correct_poses.tsv"
    wildcard_constraints:
        round=r"[1-9]\d*",
    conda:
        "../../environment.yml"
    params:
        truth=lambda w, input: flows.option("truth", input.get("truth")),
        sources=sources_of("alignerf.correct_poses"),
    shell:
        "python -m alignerf.correct_poses --scene results/{wildcards.scene:q}"
        " --cameras {input.used:q} --flow {input.flow:q} --depth {input.depth:q}"
        " {params.truth:q} --out {output.cameras:q} --report {output.report:q}"
        " 2>&1 | tee {log:q}"


# The same between pre-training and fine-tuning.
use rule align as align_pretrained with:
    input:
        renders="results/{scene}/pretrain/{model}/renders/train",
        depth="results/{scene}/pretrain/{model}/depth/train",
        photos="results/{scene}/images",
    output:
        flow=directory("results/{scene}/pretrain/{model}/flow/train"),
        warped=directory("results/{scene}/pretrain/{model}/warped/train"),
        stats="results/{scene}/pretrain/{model}/displacement_train.csv",
    log:
        "results/{scene}/pretrain/{model}/logs/align.log",
    benchmark:
        "results/{scene}/pretrain/{model}/logs/align.tsv"
    wildcard_constraints:
        model=plan.one_of(config["models"]),
    params:
        flow=lambda w: flows.of_views(experiment, w.scene, "pretrain", w.model),
        splits=["train"],


use rule correct_poses as correct_pretrained with:
    input:
        unpack(lambda w: rows.truth_of(experiment, w.scene)),
        flow="results/{scene}/pretrain/{model}/flow/train",
        depth="results/{scene}/pretrain/{model}/depth/train",
        used="results/{scene}/cameras.npz",
        cameras="results/{scene}/cameras.npz",
    output:
        cameras="results/{scene}/pretrain/{model}/corrected/cameras.npz",
        report="results/{scene}/pretrain/{model}/corrected/poses_corrected.json",
    log:
        "results/{scene}/pretrain/{model}/logs/correct_poses.log",
    benchmark:
        "results/{scene}/pretrain/{model}/logs/correct_poses.tsv"
    wildcard_constraints:
        model=plan.one_of(config["models"]),
