# What a reader looks at: the misalignment table and the figures of a scene.
rule misalignment_table:
    input:
        table_inputs,
    output:
        csv=report(
            "results/{scene}/tables/misalignment.csv",
            caption="../report/misalignment.rst",
            category="{scene}",
        ),
        tex="results/{scene}/tables/misalignment.tex",
    log:
        "results/{scene}/logs/tables.log",
    benchmark:
        "results/{scene}/logs/tables.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: as_json(table_rows(w.scene)),
        sources=sources_of("alignerf.tables.misalignment"),
    shell:
        "python -m alignerf.tables.misalignment --rows {params.rows:q} --csv {output.csv:q}"
        " --tex {output.tex:q} 2>&1 | tee {log:q}"


rule round_times:
    input:
        time_inputs,
    output:
        csv="results/{scene}/tables/round_times.csv",
        tex="results/{scene}/tables/round_times.tex",
    log:
        "results/{scene}/logs/round_times.log",
    benchmark:
        "results/{scene}/logs/round_times.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: as_json(time_rows(w.scene)),
        sources=sources_of("alignerf.tables.round_times"),
    shell:
        "python -m alignerf.tables.round_times --rows {params.rows:q} --csv {output.csv:q}"
        " --tex {output.tex:q} 2>&1 | tee {log:q}"


# How much of the warped test set's gain is alignment.
rule controls_table:
    input:
        score_inputs,
    output:
        csv=report(
            "results/{scene}/tables/controls.csv",
            caption="../report/controls.rst",
            category="{scene}",
        ),
        tex="results/{scene}/tables/controls.tex",
    log:
        "results/{scene}/logs/controls_table.log",
    benchmark:
        "results/{scene}/logs/controls_table.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: as_json(score_rows(w.scene)),
        sources=sources_of("alignerf.tables.controls"),
    shell:
        "python -m alignerf.tables.controls --rows {params.rows:q} --csv {output.csv:q}"
        " --tex {output.tex:q} 2>&1 | tee {log:q}"


# Whether the other test sets rank methods as the oracle does.
rule ranking_table:
    input:
        score_inputs,
    output:
        csv=report(
            "results/{scene}/tables/ranking.csv",
            caption="../report/ranking.rst",
            category="{scene}",
        ),
        tex="results/{scene}/tables/ranking.tex",
    log:
        "results/{scene}/logs/ranking_table.log",
    benchmark:
        "results/{scene}/logs/ranking_table.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: as_json(score_rows(w.scene)),
        sources=sources_of("alignerf.tables.ranking"),
    shell:
        "python -m alignerf.tables.ranking --rows {params.rows:q} --csv {output.csv:q}"
        " --tex {output.tex:q} 2>&1 | tee {log:q}"


rule figures:
    input:
        lambda w: [path for entry in figure_rounds(w.scene) for path in entry.values()],
        images="results/{scene}/images",
        testset="results/{scene}/testset/displacement.csv",
        reference=lambda w: figure_rounds(w.scene)[reference_round(w.scene)]["renders"],
        parts=lambda w: f"{figure_folder(w.scene)}/parts/test",
        curves=lambda w: [
            row[key]
            for row in displacement_rows(w.scene)
            for key in ("stats", "metrics")
        ],
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
        rounds=lambda w: as_json(figure_rounds(w.scene)),
        curves=lambda w: as_json(displacement_rows(w.scene)),
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
        lambda w: [
            entry[key]
            for entry in crop_methods(w.scene)
            for key in ("renders", "flow")
        ],
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
        methods=lambda w: as_json(crop_methods(w.scene)),
        sources=sources_of("flow.figures.crops"),
    shell:
        "python -m flow.figures.crops --photos {input.images:q}"
        " --methods {params.methods:q} --figure {output:q} 2>&1 | tee {log:q}"
