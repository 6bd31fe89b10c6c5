# What users can turn, what it costs and what it brings: a model and variants of it.
# Each job takes the whole machine, so that its seconds are its own.
rule shrink:
    input:
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
    output:
        images=directory("results/{scene}/tradeoff/downscale-{factor}/images"),
        cameras="results/{scene}/tradeoff/downscale-{factor}/cameras.npz",
    log:
        "results/{scene}/tradeoff/logs/shrink-{factor}.log",
    benchmark:
        "results/{scene}/tradeoff/logs/shrink-{factor}.tsv"
    wildcard_constraints:
        factor=r"[\d.]+",
    conda:
        "../../environment.yml"
    params:
        out=subpath(output.cameras, parent=True),
        sources=sources_of("alignerf.shrink"),
    shell:
        "python -m alignerf.shrink --scene results/{wildcards.scene:q}"
        " --factor {wildcards.factor:q} --out {params.out:q} 2>&1 | tee {log:q}"


use rule train as train_variant with:
    input:
        unpack(lambda w: sweep.photos_of_variant(experiment, w.scene, w.variant)),
        decisions=lambda w: rows.decisions_of(experiment, w.scene),
    output:
        model="results/{scene}/tradeoff/{variant}/model.msgpack",
        timing="results/{scene}/tradeoff/{variant}/timing.json",
    log:
        "results/{scene}/tradeoff/{variant}/logs/train.log",
    benchmark:
        "results/{scene}/tradeoff/{variant}/logs/train.tsv"
    threads: sources.WHOLE_MACHINE
    params:
        config=lambda w: slices.of_variant(experiment, w.variant),


use rule render_views as render_variant with:
    input:
        model="results/{scene}/tradeoff/{variant}/model.msgpack",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: rows.decisions_of(experiment, w.scene),
        used="results/{scene}/cameras.npz",
    output:
        renders=directory("results/{scene}/tradeoff/{variant}/renders/test"),
        timing="results/{scene}/tradeoff/{variant}/render_test.json",
    log:
        "results/{scene}/tradeoff/{variant}/logs/render.log",
    benchmark:
        "results/{scene}/tradeoff/{variant}/logs/render.tsv"
    wildcard_constraints:
        variant=plan.one_of(sweep.names(experiment)),
    threads: sources.WHOLE_MACHINE
    params:
        config=lambda w: slices.of_variant(experiment, w.variant),


use rule evaluate as evaluate_variant with:
    input:
        unpack(lambda w: rows.truth_of(experiment, w.scene)),
        renders="results/{scene}/tradeoff/{variant}/renders/test",
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        weights=local(list(config["lpips"].values())),
    output:
        "results/{scene}/tradeoff/{variant}/metrics.csv",
    log:
        "results/{scene}/tradeoff/{variant}/logs/evaluate.log",
    benchmark:
        "results/{scene}/tradeoff/{variant}/logs/evaluate.tsv"
    params:
        testset=[],


rule tradeoff:
    input:
        lambda w: rows.files_of(check.or_exit(sweep.rows, experiment)),
        configs=lambda w: check.or_exit(sweep.configs, experiment),
    output:
        csv=report(
            "results/tradeoff.csv",
            caption="../report/tradeoff.rst",
            category="tradeoff",
            labels={"what": "tradeoff", "kind": "table"},
        ),
        tex="results/tradeoff.tex",
        provenance="results/tradeoff.provenance.json",
        figure=report(
            "results/tradeoff.png",
            caption="../report/tradeoff.rst",
            category="tradeoff",
            labels={"what": "tradeoff", "kind": "figure"},
        ),
    log:
        "results/logs/tradeoff.log",
    benchmark:
        "results/logs/tradeoff.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: rows.as_json(sweep.rows(experiment)),
        sources=sources_of("alignerf.tables.tradeoff"),
    shell:
        "python -m alignerf.tables.tradeoff --rows {params.rows:q}"
        " --configs {input.configs:q} --csv {output.csv:q} --tex {output.tex:q}"
        " --figure {output.figure:q} 2>&1 | tee {log:q}"
