# What a reader looks at: the misalignment table and the figures of a scene.
def table_rows(scene):
    """One entry per method and round, with the files that its row comes from."""
    return [
        {
            "method": method,
            "field": field_name(method),
            "round": round,
            "metrics": f"{trained(scene, method, round)}/metrics.csv",
            "trainings": trainings_of(scene, method, round),
            "data": data_of(scene, method, round),
        }
        for method, round in all_rounds()
    ]


def table_inputs(w):
    rows = table_rows(w.scene)
    files = [[r["metrics"], *r["trainings"], *r["data"]] for r in rows]
    return sorted({path for row in files for path in row})


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
        sources=sources_of("alignerf.tables"),
    shell:
        "python -m alignerf.tables --rows {params.rows:q} --csv {output.csv:q}"
        " --tex {output.tex:q} 2>&1 | tee {log:q}"


def figure_rounds(scene):
    """Renders and flow of the test views, round by round, of the reference method."""
    method = config["reference"]["method"]
    return [
        {
            "renders": f"{trained(scene, method, k)}/renders/test",
            "flow": f"{trained(scene, method, k)}/flow/test",
        }
        for k in range(config["methods"][method]["rounds"] + 1)
    ]


rule figures:
    input:
        lambda w: [path for entry in figure_rounds(w.scene) for path in entry.values()],
        images="results/{scene}/images",
        testset="results/{scene}/testset/displacement.csv",
        reference=lambda w: figure_rounds(w.scene)[config["reference"]["round"]][
            "renders"
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
    log:
        "results/{scene}/logs/figures.log",
    benchmark:
        "results/{scene}/logs/figures.tsv"
    conda:
        "../../environment.yml"
    params:
        rounds=lambda w: as_json(figure_rounds(w.scene)),
        sources=sources_of("flow.figures"),
    shell:
        "python -m flow.figures --photos {input.images:q}"
        " --testset results/{wildcards.scene:q}/testset --reference {input.reference:q}"
        " --rounds {params.rounds:q} --flow-figure {output.flow:q}"
        " --rounds-figure {output.rounds:q} 2>&1 | tee {log:q}"
