# When each of the method's parts pays: all scenes of the config, those that differ in
# their seed only as one regime.
rule regimes:
    input:
        lambda w: rows.files_of(check.or_exit(regimes.scenes, experiment)),
        configs=expand("results/{scene}/config.yaml", scene=experiment.scenes),
    output:
        csv=report(
            f"results/{regimes.name(experiment)}.csv",
            caption="../report/regimes.rst",
            category="regimes",
            labels={"what": "regimes", "kind": "table"},
        ),
        tex=f"results/{regimes.name(experiment)}.tex",
        provenance=f"results/{regimes.name(experiment)}.provenance.json",
        figure=report(
            f"results/{regimes.name(experiment)}.png",
            caption="../report/regimes.rst",
            category="regimes",
            labels={"what": "regimes", "kind": "figure"},
        ),
    log:
        "results/logs/regimes.log",
    benchmark:
        "results/logs/regimes.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: rows.as_json(regimes.scenes(experiment)),
        sources=sources_of("alignerf.tables.regimes"),
    shell:
        "python -m alignerf.tables.regimes --rows {params.rows:q}"
        " --configs {input.configs:q} --csv {output.csv:q} --tex {output.tex:q}"
        " --figure {output.figure:q} 2>&1 | tee {log:q}"
