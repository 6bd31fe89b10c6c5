# Trainings. Round 0 trains on the photos, round k on those that round k - 1 warped, or
# with the cameras that were put right by its flow; from scratch, or from the weights of
# round k - 1; staged methods pre-train once a model, then fine-tune. Checkpoints lie
# outside of `output:`, which Snakemake deletes when a job is killed: a training resumes.
rule train:
    input:
        unpack(lambda w: rows.photos_of_round(experiment, w.scene, w.method, w.round)),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: rows.decisions_of(experiment, w.scene),
        used=lambda w: experiment.cameras_of(w.scene, w.method, w.round),
        preflight="results/{scene}/preflight.json",
    output:
        model="results/{scene}/{method}/round{round}/model.msgpack",
        timing="results/{scene}/{method}/round{round}/timing.json",
    log:
        "results/{scene}/{method}/round{round}/logs/train.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/train.tsv"
    wildcard_constraints:
        method=plan.one_of(experiment.from_scratch()),
    conda:
        "../../environment.yml"
    threads: sources.OF_TRAINING
    resources:
        gpu=sources.ACCELERATORS,
        launcher="",
        mem_mb=needs.memory_mb(costs, "{method}/round{round}/timing.json"),
        runtime=needs.minutes(costs, "{method}/round{round}/timing.json"),
    params:
        config=lambda w: slices.of_round(experiment, w.scene, w.method),
        scene=subpath(input.cameras, parent=True),
        more=[],
        valid=lambda w, input: flows.option("valid", input.get("valid")),
        checkpoints=subpath(output.model, parent=True),
        sources=sources_of("alignerf.train"),
    shell:
        "{resources.launcher} python -m alignerf.train --config {params.config:q}"
        " --scene {params.scene:q} --photos {input.photos:q}"
        " --cameras {input.used:q} {params.valid:q} {params.more:q}"
        " --checkpoints {params.checkpoints:q}/checkpoints"
        " --sources {params.sources} --model {output.model:q}"
        " --timing {output.timing:q} --threads {threads} 2>&1 | tee {log:q}"


use rule train as train_warm with:
    input:
        unpack(lambda w: rows.photos_of_round(experiment, w.scene, w.method, w.round)),
        initial=lambda w: "{}/model.msgpack".format(
            experiment.folder(w.scene, w.method, int(w.round) - 1)
        ),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: rows.decisions_of(experiment, w.scene),
        used=lambda w: experiment.cameras_of(w.scene, w.method, w.round),
        preflight="results/{scene}/preflight.json",
    wildcard_constraints:
        method=plan.one_of(experiment.warm()),
        round=r"[1-9]\d*",
    params:
        more=lambda w, input: ["--initial", input.initial],


# Cameras learnt with the scene: its renders are made with these.
use rule train as train_refining with:
    input:
        unpack(lambda w: rows.photos_of_round(experiment, w.scene, w.method, w.round)),
        unpack(lambda w: rows.truth_of(experiment, w.scene)),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: rows.decisions_of(experiment, w.scene),
        used=lambda w: experiment.cameras_of(w.scene, w.method, w.round),
        preflight="results/{scene}/preflight.json",
    output:
        model="results/{scene}/{method}/round{round}/model.msgpack",
        timing="results/{scene}/{method}/round{round}/timing.json",
        cameras="results/{scene}/{method}/round{round}/refined/cameras.npz",
    wildcard_constraints:
        method=plan.one_of(experiment.refining()),
    params:
        more=lambda w, input, output: [
            *flows.option("cameras-out", output.cameras),
            *flows.option("truth", input.get("truth")),
        ],


# Cameras and photos put right on the way: its renders are made with these cameras.
use rule train as train_aligning with:
    input:
        unpack(lambda w: rows.photos_of_round(experiment, w.scene, w.method, w.round)),
        unpack(lambda w: rows.truth_of(experiment, w.scene)),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: rows.decisions_of(experiment, w.scene),
        used=lambda w: experiment.cameras_of(w.scene, w.method, w.round),
        preflight="results/{scene}/preflight.json",
    output:
        model="results/{scene}/{method}/round{round}/model.msgpack",
        timing="results/{scene}/{method}/round{round}/timing.json",
        cameras="results/{scene}/{method}/round{round}/aligned/cameras.npz",
        photos=directory("results/{scene}/{method}/round{round}/aligned/photos"),
        valid=directory("results/{scene}/{method}/round{round}/aligned/valid"),
    wildcard_constraints:
        method=plan.one_of(experiment.aligning()),
    params:
        more=lambda w, input, output: [
            *flows.option("aligned-out", output.cameras.rpartition("/")[0]),
            *flows.option("truth", input.get("truth")),
        ],
        # The second is what the first takes the flow by (`train.make_aligner`).
        sources=sources_of("alignerf.train", "alignerf.alignment.aligner"),


rule pretrain:
    input:
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: rows.decisions_of(experiment, w.scene),
        preflight="results/{scene}/preflight.json",
    output:
        model="results/{scene}/pretrain/{model}/model.msgpack",
        timing="results/{scene}/pretrain/{model}/timing.json",
    log:
        "results/{scene}/pretrain/{model}/logs/train.log",
    benchmark:
        "results/{scene}/pretrain/{model}/logs/train.tsv"
    wildcard_constraints:
        model=plan.one_of(config["models"]),
    conda:
        "../../environment.yml"
    threads: sources.OF_TRAINING
    resources:
        gpu=sources.ACCELERATORS,
        launcher="",
        mem_mb=needs.memory_mb(costs, "pretrain/{model}/timing.json"),
        runtime=needs.minutes(costs, "pretrain/{model}/timing.json"),
    params:
        config=lambda w: slices.of_pretraining(experiment, w.scene, w.model),
        checkpoints=subpath(output.model, parent=True),
        sources=sources_of("alignerf.train"),
    shell:
        "{resources.launcher} python -m alignerf.train --config {params.config:q}"
        " --scene results/{wildcards.scene:q} --photos {input.images:q}"
        " --checkpoints {params.checkpoints:q}/checkpoints"
        " --sources {params.sources} --model {output.model:q}"
        " --timing {output.timing:q} --threads {threads} 2>&1 | tee {log:q}"


rule finetune:
    input:
        unpack(lambda w: rows.displacement_for_radius(experiment, w.scene, w.method)),
        initial=lambda w: "{}/model.msgpack".format(
            experiment.pretrained(w.scene, w.method)
        ),
        weights=lambda w: local(slices.frequency_weights_of(experiment, w.method) or []),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: rows.decisions_of(experiment, w.scene),
        used=lambda w: experiment.cameras_of(w.scene, w.method, 0),
        preflight="results/{scene}/preflight.json",
    output:
        model="results/{scene}/{method}/round0/model.msgpack",
        timing="results/{scene}/{method}/round0/timing.json",
    log:
        "results/{scene}/{method}/round0/logs/train.log",
    benchmark:
        "results/{scene}/{method}/round0/logs/train.tsv"
    wildcard_constraints:
        method=plan.one_of(experiment.staged()),
    conda:
        "../../environment.yml"
    threads: sources.OF_TRAINING
    resources:
        gpu=sources.ACCELERATORS,
        launcher="",
        mem_mb=needs.memory_mb(costs, "{method}/round0/timing.json"),
        runtime=needs.minutes(costs, "{method}/round0/timing.json"),
    params:
        config=lambda w: slices.of_round(experiment, w.scene, w.method),
        displacement=lambda w, input: flows.option(
            "displacement", input.get("displacement")
        ),
        checkpoints=subpath(output.model, parent=True),
        sources=sources_of("alignerf.train"),
    shell:
        "{resources.launcher} python -m alignerf.train --config {params.config:q}"
        " --scene results/{wildcards.scene:q} --photos {input.images:q}"
        " --initial {input.initial:q} --cameras {input.used:q}"
        " {params.displacement:q} --checkpoints {params.checkpoints:q}/checkpoints"
        " --sources {params.sources} --model {output.model:q}"
        " --timing {output.timing:q} --threads {threads} 2>&1 | tee {log:q}"


rule render_views:
    input:
        model="results/{scene}/{method}/round{round}/model.msgpack",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: rows.decisions_of(experiment, w.scene),
        used=lambda w: experiment.rendered_with(w.scene, w.method, w.round),
    output:
        renders=directory("results/{scene}/{method}/round{round}/renders/test"),
        depth=directory("results/{scene}/{method}/round{round}/depth/test"),
        timing="results/{scene}/{method}/round{round}/render_test.json",
    log:
        "results/{scene}/{method}/round{round}/logs/render.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/render.tsv"
    wildcard_constraints:
        method=plan.at_rounds(experiment.followed(), others=True),
    conda:
        "../../environment.yml"
    threads: sources.OF_TRAINING
    resources:
        gpu=sources.ACCELERATORS,
        mem_mb=needs.memory_mb(costs, "{method}/round{round}/render_test.json"),
        runtime=needs.minutes(costs, "{method}/round{round}/render_test.json"),
    params:
        config=lambda w: slices.of_round(experiment, w.scene, w.method),
        splits=["test"],
        folder=subpath(output.timing, parent=True),
        depth=lambda w, output: flows.with_split("depth", output.get("depth")),
        sources=sources_of("alignerf.render_views"),
    shell:
        "python -m alignerf.render_views --config {params.config:q}"
        " --scene results/{wildcards.scene:q} --model {input.model:q}"
        " --cameras {input.used:q}"
        " --splits {params.splits} --renders {params.folder:q}/renders/{{split}}"
        " {params.depth:q} --timing {params.folder:q}/render_{{split}}.json"
        " --threads {threads} 2>&1 | tee {log:q}"


# The training views too, where another round, or a search radius, comes from them.
use rule render_views as render_all_views with:
    output:
        train_renders=directory("results/{scene}/{method}/round{round}/renders/train"),
        train_depth=directory("results/{scene}/{method}/round{round}/depth/train"),
        train_timing="results/{scene}/{method}/round{round}/render_train.json",
        renders=directory("results/{scene}/{method}/round{round}/renders/test"),
        depth=directory("results/{scene}/{method}/round{round}/depth/test"),
        timing="results/{scene}/{method}/round{round}/render_test.json",
    wildcard_constraints:
        method=plan.at_rounds(experiment.followed()),
    params:
        splits=["train", "test"],


# After pre-training, where cameras are put right before fine-tuning.
use rule render_views as render_pretrained with:
    input:
        model="results/{scene}/pretrain/{model}/model.msgpack",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: rows.decisions_of(experiment, w.scene),
        used="results/{scene}/cameras.npz",
    output:
        renders=directory("results/{scene}/pretrain/{model}/renders/train"),
        depth=directory("results/{scene}/pretrain/{model}/depth/train"),
        timing="results/{scene}/pretrain/{model}/render_train.json",
    log:
        "results/{scene}/pretrain/{model}/logs/render.log",
    benchmark:
        "results/{scene}/pretrain/{model}/logs/render.tsv"
    wildcard_constraints:
        model=plan.one_of(config["models"]),
    resources:
        gpu=sources.ACCELERATORS,
        mem_mb=needs.memory_mb(costs, "pretrain/{model}/render_train.json"),
        runtime=needs.minutes(costs, "pretrain/{model}/render_train.json"),
    params:
        config=lambda w: slices.of_pretraining(experiment, w.scene, w.model),
        splits=["train"],
