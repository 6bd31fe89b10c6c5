# The paper's Tables 2 and 3: all methods on all scenes, and what is printed for them.
rule comparison:
    input:
        lambda w: rows.files_of(check.or_exit(regimes.comparison, experiment)),
        configs=expand("results/{scene}/config.yaml", scene=experiment.scenes),
        published=local(rows.published_table()),
    output:
        csv=report(
            "results/comparison.csv",
            caption="../report/comparison.rst",
            category="comparison",
            labels={"what": "comparison", "kind": "table"},
        ),
        tex="results/comparison.tex",
        provenance="results/comparison.provenance.json",
        ranking=report(
            "results/comparison_ranking.csv",
            caption="../report/comparison.rst",
            category="comparison",
            labels={"what": "ranking", "kind": "table"},
        ),
    log:
        "results/logs/comparison.log",
    benchmark:
        "results/logs/comparison.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: rows.as_json(regimes.comparison(experiment)),
        table=flows.option("published-table", config["published_table"]),
        sources=sources_of("alignerf.tables.comparison"),
    shell:
        "python -m alignerf.tables.comparison --rows {params.rows:q}"
        " --published {input.published:q} {params.table:q}"
        " --configs {input.configs:q} --csv {output.csv:q} --tex {output.tex:q}"
        " --ranking {output.ranking:q} 2>&1 | tee {log:q}"
