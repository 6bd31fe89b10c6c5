# What the misalignment of the test views is made of: the camera's part, the rest and,
# where the truth is known, the model's own part.
rule align_oracle:
    input:
        renders="results/{scene}/{method}/round{round}/renders/test",
        truth="results/{scene}/truth",
    output:
        flow=directory("results/{scene}/{method}/round{round}/flow_oracle/test"),
        stats="results/{scene}/{method}/round{round}/displacement_oracle.csv",
    log:
        "results/{scene}/{method}/round{round}/logs/align_oracle.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/align_oracle.tsv"
    conda:
        "../../environment.yml"
    params:
        flow=flows.estimator_options(experiment),
        sources=sources_of("flow.align"),
    shell:
        "python -m flow.align {params.flow:q} --renders {input.renders:q}"
        " --photos {input.truth:q}/oracle --flow-out {output.flow:q}"
        " --stats-out {output.stats:q} 2>&1 | tee {log:q}"


rule decompose:
    input:
        unpack(lambda w: flows.of_oracle(experiment, w.scene, w.method, w.round)),
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
    conda:
        "../../environment.yml"
    params:
        model=lambda w, input: flows.option("model-flow", input.get("model")),
        sources=sources_of("flow.decompose"),
    shell:
        "python -m flow.decompose --renders-depth {input.depth:q}"
        " --flow {input.flow:q} {params.model:q} --cameras {input.cameras:q}"
        " --split test --out-flow {output.parts:q} --stats-out {output.stats:q}"
        " 2>&1 | tee {log:q}"


rule displacement_table:
    input:
        lambda w: [row.stats for row in rows.displacement(experiment, w.scene)],
        configs="results/{scene}/config.yaml",
    output:
        csv=report(
            "results/{scene}/tables/displacement.csv",
            caption="../report/displacement.rst",
            category="{scene}",
        ),
        tex="results/{scene}/tables/displacement.tex",
        provenance="results/{scene}/tables/displacement.provenance.json",
    log:
        "results/{scene}/logs/displacement_table.log",
    benchmark:
        "results/{scene}/logs/displacement_table.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: rows.as_json(rows.displacement(experiment, w.scene)),
        sources=sources_of("alignerf.tables.displacement"),
    shell:
        "python -m alignerf.tables.displacement --rows {params.rows:q}"
        " --configs {input.configs:q} --csv {output.csv:q} --tex {output.tex:q}"
        " 2>&1 | tee {log:q}"
