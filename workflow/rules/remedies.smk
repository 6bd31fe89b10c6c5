# What to do with T minutes: every remedy at several lengths, compared at equal time.
rule remedies:
    input:
        lambda w: rows.files_of(check.or_exit(regimes.remedies, experiment)),
        configs=expand("results/{scene}/config.yaml", scene=experiment.scenes),
    output:
        csv=report(
            "results/remedies.csv",
            caption="../report/remedies.rst",
            category="remedies",
            labels={"what": "remedies", "kind": "table"},
        ),
        tex="results/remedies.tex",
        provenance="results/remedies.provenance.json",
        figure=report(
            "results/remedies.png",
            caption="../report/remedies.rst",
            category="remedies",
            labels={"what": "remedies", "kind": "figure"},
        ),
    log:
        "results/logs/remedies.log",
    benchmark:
        "results/logs/remedies.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: rows.as_json(regimes.remedies(experiment)),
        sources=sources_of("alignerf.tables.remedies"),
    shell:
        "python -m alignerf.tables.remedies --rows {params.rows:q}"
        " --configs {input.configs:q} --csv {output.csv:q} --tex {output.tex:q}"
        " --figure {output.figure:q} 2>&1 | tee {log:q}"
