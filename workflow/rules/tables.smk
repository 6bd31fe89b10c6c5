# What a reader looks at: the misalignment table and the figures of a scene.
rule misalignment_table:
    input:
        lambda w: rows.files_of(rows.misalignment(experiment, w.scene)),
        configs="results/{scene}/config.yaml",
        published=lambda w: rows.published(w.scene),
    output:
        csv=report(
            "results/{scene}/tables/misalignment.csv",
            caption="../report/misalignment.rst",
            category="{scene}",
        ),
        tex="results/{scene}/tables/misalignment.tex",
        provenance="results/{scene}/tables/misalignment.provenance.json",
    log:
        "results/{scene}/logs/tables.log",
    benchmark:
        "results/{scene}/logs/tables.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: rows.as_json(rows.misalignment(experiment, w.scene)),
        sources=sources_of("alignerf.tables.misalignment"),
    shell:
        "python -m alignerf.tables.misalignment --rows {params.rows:q}"
        " --scene-name {wildcards.scene:q} --published {input.published:q}"
        " --configs {input.configs:q} --csv {output.csv:q} --tex {output.tex:q}"
        " 2>&1 | tee {log:q}"


rule round_times:
    input:
        lambda w: rows.files_of(rows.times(experiment, w.scene)),
        configs="results/{scene}/config.yaml",
    output:
        csv="results/{scene}/tables/round_times.csv",
        tex="results/{scene}/tables/round_times.tex",
        provenance="results/{scene}/tables/round_times.provenance.json",
    log:
        "results/{scene}/logs/round_times.log",
    benchmark:
        "results/{scene}/logs/round_times.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: rows.as_json(rows.times(experiment, w.scene)),
        sources=sources_of("alignerf.tables.round_times"),
    shell:
        "python -m alignerf.tables.round_times --rows {params.rows:q}"
        " --configs {input.configs:q} --csv {output.csv:q} --tex {output.tex:q}"
        " 2>&1 | tee {log:q}"


# How much of the warped test set's gain is alignment.
rule controls_table:
    input:
        lambda w: rows.files_of(rows.scores(experiment, w.scene)),
        configs="results/{scene}/config.yaml",
    output:
        csv=report(
            "results/{scene}/tables/controls.csv",
            caption="../report/controls.rst",
            category="{scene}",
        ),
        tex="results/{scene}/tables/controls.tex",
        provenance="results/{scene}/tables/controls.provenance.json",
    log:
        "results/{scene}/logs/controls_table.log",
    benchmark:
        "results/{scene}/logs/controls_table.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: rows.as_json(rows.scores(experiment, w.scene)),
        sources=sources_of("alignerf.tables.controls"),
    shell:
        "python -m alignerf.tables.controls --rows {params.rows:q}"
        " --configs {input.configs:q} --csv {output.csv:q} --tex {output.tex:q}"
        " 2>&1 | tee {log:q}"


# Whether the other test sets rank methods as the oracle does.
rule ranking_table:
    input:
        lambda w: rows.files_of(rows.scores(experiment, w.scene)),
        configs="results/{scene}/config.yaml",
    output:
        csv=report(
            "results/{scene}/tables/ranking.csv",
            caption="../report/ranking.rst",
            category="{scene}",
        ),
        tex="results/{scene}/tables/ranking.tex",
        provenance="results/{scene}/tables/ranking.provenance.json",
    log:
        "results/{scene}/logs/ranking_table.log",
    benchmark:
        "results/{scene}/logs/ranking_table.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: rows.as_json(rows.scores(experiment, w.scene)),
        sources=sources_of("alignerf.tables.ranking"),
    shell:
        "python -m alignerf.tables.ranking --rows {params.rows:q}"
        " --configs {input.configs:q} --csv {output.csv:q} --tex {output.tex:q}"
        " 2>&1 | tee {log:q}"


rule figures:
    input:
        lambda w: rows.files_of(rows.figure_rounds(experiment, w.scene)),
        images="results/{scene}/images",
        testset="results/{scene}/testset/displacement.csv",
        reference=lambda w: f"{experiment.reference_folder(w.scene)}/renders/test",
        parts=lambda w: f"{experiment.reference_folder(w.scene, 0)}/parts/test",
        curves=lambda w: rows.files_of(rows.displacement(experiment, w.scene)),
    output:
        flow=report(
            "results/{scene}/figures/flow.png",
            caption="../report/flow.rst",
            category="{scene}",
        ),
        rounds=report(
            "results/{scene}/figures/rounds.png",
            caption="../report/rounds.rst",
            category="{scene}",
        ),
        views=report(
            "results/{scene}/figures/views.png",
            caption="../report/views.rst",
            category="{scene}",
        ),
        lengths=report(
            "results/{scene}/figures/lengths.png",
            caption="../report/lengths.rst",
            category="{scene}",
        ),
        curves=report(
            "results/{scene}/figures/curves.png",
            caption="../report/curves.rst",
            category="{scene}",
        ),
    log:
        "results/{scene}/logs/figures.log",
    benchmark:
        "results/{scene}/logs/figures.tsv"
    conda:
        "../../environment.yml"
    params:
        rounds=lambda w: rows.as_json(rows.figure_rounds(experiment, w.scene)),
        curves=lambda w: rows.as_json(rows.displacement(experiment, w.scene)),
        sources=sources_of("flow.figures.scene"),
    shell:
        "python -m flow.figures.scene --photos {input.images:q}"
        " --testset results/{wildcards.scene:q}/testset --reference {input.reference:q}"
        " --rounds {params.rounds:q} --flow-figure {output.flow:q}"
        " --rounds-figure {output.rounds:q} --parts {input.parts:q}"
        " --curves {params.curves:q} --views-figure {output.views:q}"
        " --lengths-figure {output.lengths:q} --curves-figure {output.curves:q}"
        " 2>&1 | tee {log:q}"


# The baseline and the staged methods side by side.
rule crops:
    input:
        lambda w: rows.files_of(rows.crops(experiment, w.scene)),
        images="results/{scene}/images",
    output:
        report(
            "results/{scene}/figures/crops.png",
            caption="../report/crops.rst",
            category="{scene}",
        ),
    log:
        "results/{scene}/logs/crops.log",
    benchmark:
        "results/{scene}/logs/crops.tsv"
    conda:
        "../../environment.yml"
    params:
        methods=lambda w: rows.as_json(rows.crops(experiment, w.scene)),
        sources=sources_of("flow.figures.crops"),
    shell:
        "python -m flow.figures.crops --photos {input.images:q}"
        " --methods {params.methods:q} --figure {output:q} 2>&1 | tee {log:q}"
