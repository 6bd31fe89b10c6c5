# Scores and costs, a row each: of a scene's tables, or of one across scenes.
rule collect:
    input:
        lambda w: rows.files_of(scenes.rows_of(experiment, w.scene, w.table)),
    output:
        scores="results/{scene}/{table}scores.csv",
        trainings="results/{scene}/{table}trainings.csv",
    log:
        "results/{scene}/logs/{table}collect.log",
    benchmark:
        "results/{scene}/logs/{table}collect.tsv"
    wildcard_constraints:
        table="|".join(["", *(f"{table}/" for table in scenes.OF_TABLES)]),
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: rows.as_json(scenes.rows_of(experiment, w.scene, w.table)),
        sources=sources_of("alignerf.tables.collect"),
    shell:
        "python -m alignerf.tables.collect --rows {params.rows:q}"
        " --scores {output.scores:q} --trainings {output.trainings:q}"
        " 2>&1 | tee {log:q}"


# What a reader looks at: the tables and the figures of a scene.
rule tables:
    input:
        scores="results/{scene}/scores.csv",
        trainings="results/{scene}/trainings.csv",
        configs="results/{scene}/config.yaml",
        published=lambda w: local(rows.published(w.scene)),
    output:
        [
            report(
                f"results/{{scene}}/tables/{table}.csv",
                caption=f"../report/{table}.rst",
                category="{scene}",
                labels={"what": table, "kind": "table"},
            )
            for table in targets.reported(known=False)
        ],
        targets.beside(known=False),
    log:
        "results/{scene}/logs/tables.log",
    benchmark:
        "results/{scene}/logs/tables.tsv"
    wildcard_constraints:
        scene=plan.one_of(experiment.with_truth(False)),
    conda:
        "../../environment.yml"
    params:
        tables=lambda w: targets.tables(experiment.has_truth(w.scene)),
        sources=sources_of("alignerf.tabulate"),
    shell:
        "python -m alignerf.tabulate --scene results/{wildcards.scene:q}"
        " --tables {params.tables} --published {input.published:q}"
        " --configs {input.configs:q} --out results/{wildcards.scene:q}/tables"
        " 2>&1 | tee {log:q}"


use rule tables as tables_courtyard with:
    output:
        [
            report(
                f"results/{{scene}}/tables/{table}.csv",
                caption=f"../report/{table}.rst",
                category="{scene}",
                labels={"what": table, "kind": "table"},
            )
            for table in targets.reported(known=True)
        ],
        targets.beside(known=True),
    wildcard_constraints:
        scene=plan.one_of(experiment.with_truth(True)),


rule figures:
    input:
        lambda w: rows.shown_in(rows.figure_rounds(experiment, w.scene)),
        lambda w: rows.shown_in(rows.crops(experiment, w.scene)),
        images="results/{scene}/images",
        flow="results/{scene}/testset/flow",
        testset="results/{scene}/testset/displacement.csv",
        reference=lambda w: f"{experiment.reference_folder(w.scene)}/renders",
        parts=lambda w: f"{experiment.reference_folder(w.scene, 0)}/parts/test",
        curves="results/{scene}/scores.csv",
    output:
        [
            report(
                f"results/{{scene}}/figures/{figure}.png",
                caption=f"../report/{figure}.rst",
                category="{scene}",
                labels={"what": figure, "kind": "figure"},
            )
            for figure in targets.figures(experiment)
        ],
    log:
        "results/{scene}/logs/figures.log",
    benchmark:
        "results/{scene}/logs/figures.tsv"
    conda:
        "../../environment.yml"
    params:
        rounds=lambda w: rows.as_json(rows.figure_rounds(experiment, w.scene)),
        crops=lambda w: rows.crops_option(experiment, w.scene),
        sources=sources_of("flow.figures.scene"),
    shell:
        "python -m flow.figures.scene --photos {input.images:q}"
        " --testset results/{wildcards.scene:q}/testset --reference {input.reference:q}/test"
        " --rounds {params.rounds:q} --parts {input.parts:q} --curves {input.curves:q}"
        " {params.crops:q} --out results/{wildcards.scene:q}/figures 2>&1 | tee {log:q}"
