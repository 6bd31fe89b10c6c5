# Trainings. Round 0 trains on the photos, round k on those that round k - 1 warped,
# from scratch, or from the weights of round k - 1;
# staged methods pre-train once a model, then fine-tune. Checkpoints lie outside of
# `output:`, which Snakemake deletes when a job is killed: a training resumes.
rule train:
    input:
        unpack(photos_of_round),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
    output:
        model="results/{scene}/{method}/round{round}/model.msgpack",
        timing="results/{scene}/{method}/round{round}/timing.json",
    log:
        "results/{scene}/{method}/round{round}/logs/train.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/train.tsv"
    wildcard_constraints:
        method=one_of(set(plain()) - set(warm())),
    conda:
        "../../environment.yml"
    threads: 64
    params:
        config=lambda w: method_slice(w.scene, w.method),
        scene=subpath(input.cameras, parent=True),
        initial=[],
        valid=lambda w, input: option("valid", input.get("valid")),
        checkpoints=subpath(output.model, parent=True),
        sources=sources_of("alignerf.train"),
    shell:
        "python -m alignerf.train --config {params.config:q}"
        " --scene {params.scene:q} --photos {input.photos:q}"
        " {params.valid:q} {params.initial:q}"
        " --checkpoints {params.checkpoints:q}/checkpoints"
        " --sources {params.sources} --model {output.model:q}"
        " --timing {output.timing:q} 2>&1 | tee {log:q}"


use rule train as train_warm with:
    input:
        unpack(photos_of_round),
        initial=lambda w: "{}/model.msgpack".format(
            trained(w.scene, w.method, int(w.round) - 1)
        ),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
    wildcard_constraints:
        method=one_of(warm()),
        round=r"[1-9]\d*",
    params:
        initial=lambda w, input: ["--initial", input.initial],


rule pretrain:
    input:
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
    output:
        model="results/{scene}/pretrain/{model}/model.msgpack",
        timing="results/{scene}/pretrain/{model}/timing.json",
    log:
        "results/{scene}/pretrain/{model}/logs/train.log",
    benchmark:
        "results/{scene}/pretrain/{model}/logs/train.tsv"
    wildcard_constraints:
        model=one_of(config["models"]),
    conda:
        "../../environment.yml"
    threads: 64
    params:
        config=lambda w: pretrain_slice(w.scene, w.model),
        checkpoints=subpath(output.model, parent=True),
        sources=sources_of("alignerf.train"),
    shell:
        "python -m alignerf.train --config {params.config:q}"
        " --scene results/{wildcards.scene:q} --photos {input.images:q}"
        " --checkpoints {params.checkpoints:q}/checkpoints"
        " --sources {params.sources} --model {output.model:q}"
        " --timing {output.timing:q} 2>&1 | tee {log:q}"


rule finetune:
    input:
        unpack(displacement_for_radius),
        initial=lambda w: "results/{}/pretrain/{}/model.msgpack".format(
            w.scene, config["methods"][w.method]["model"]
        ),
        weights=lambda w: frequency_weights_of(w.method) or [],
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
    output:
        model="results/{scene}/{method}/round0/model.msgpack",
        timing="results/{scene}/{method}/round0/timing.json",
    log:
        "results/{scene}/{method}/round0/logs/train.log",
    benchmark:
        "results/{scene}/{method}/round0/logs/train.tsv"
    wildcard_constraints:
        method=one_of(staged()),
    conda:
        "../../environment.yml"
    threads: 64
    params:
        config=lambda w: method_slice(w.scene, w.method),
        displacement=lambda w, input: option("displacement", input.get("displacement")),
        checkpoints=subpath(output.model, parent=True),
        sources=sources_of("alignerf.train"),
    shell:
        "python -m alignerf.train --config {params.config:q}"
        " --scene results/{wildcards.scene:q} --photos {input.images:q}"
        " --initial {input.initial:q} {params.displacement:q} --checkpoints {params.checkpoints:q}/checkpoints"
        " --sources {params.sources} --model {output.model:q}"
        " --timing {output.timing:q} 2>&1 | tee {log:q}"


rule render_views:
    input:
        model="results/{scene}/{method}/round{round}/model.msgpack",
        cameras="results/{scene}/cameras.npz",
    output:
        renders=directory("results/{scene}/{method}/round{round}/renders/{split}"),
        depth=directory("results/{scene}/{method}/round{round}/depth/{split}"),
        timing="results/{scene}/{method}/round{round}/render_{split}.json",
    log:
        "results/{scene}/{method}/round{round}/logs/render_{split}.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/render_{split}.tsv"
    conda:
        "../../environment.yml"
    threads: 64
    params:
        config=lambda w: method_slice(w.scene, w.method),
        depth=lambda w, output: option("depth", output.get("depth")),
        sources=sources_of("alignerf.render_views"),
    shell:
        "python -m alignerf.render_views --config {params.config:q}"
        " --scene results/{wildcards.scene:q} --model {input.model:q}"
        " --split {wildcards.split:q} --renders {output.renders:q}"
        " {params.depth:q} --timing {output.timing:q} 2>&1 | tee {log:q}"
