# When each of the method's parts pays: all scenes of the config, those that differ in
# their seed only as one regime.
rule regimes:
    input:
        regime_inputs,
    output:
        csv=report(
            f"results/{REGIMES}.csv",
            caption="../report/regimes.rst",
            category="regimes",
        ),
        tex=f"results/{REGIMES}.tex",
        figure=report(
            f"results/{REGIMES}.png",
            caption="../report/regimes.rst",
            category="regimes",
        ),
    log:
        "results/logs/regimes.log",
    benchmark:
        "results/logs/regimes.tsv"
    conda:
        "../../environment.yml"
    params:
        rows=lambda w: as_json(regime_scenes()),
        sources=sources_of("alignerf.tables.regimes"),
    shell:
        "python -m alignerf.tables.regimes --rows {params.rows:q} --csv {output.csv:q}"
        " --tex {output.tex:q} --figure {output.figure:q} 2>&1 | tee {log:q}"
