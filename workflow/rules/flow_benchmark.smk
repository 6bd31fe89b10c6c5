# How right and how fast the flow estimators are, where the flow is known: on public
# sequences, on warped photographs, and on the renders of the first scene of the
# config whose truth is known. Takes the whole machine, so that its speeds are its own.
rule flow_benchmark:
    input:
        lambda w: arguments.benchmark_inputs(experiment),
        configs=expand("results/{scene}/config.yaml", scene=experiment.with_truth()[:1]),
    output:
        csv=report(
            "results/flow_benchmark.csv",
            caption="../report/flow_benchmark.rst",
            category="flow estimators",
            labels={"what": "flow benchmark", "kind": "table"},
        ),
        tex="results/flow_benchmark.tex",
        provenance="results/flow_benchmark.provenance.json",
        figure=report(
            "results/flow_benchmark.png",
            caption="../report/flow_benchmark.rst",
            category="flow estimators",
            labels={"what": "flow benchmark", "kind": "figure"},
        ),
    log:
        "results/logs/flow_benchmark.log",
    benchmark:
        "results/logs/flow_benchmark.tsv"
    conda:
        "../../environment.yml"
    threads: sources.WHOLE_MACHINE
    params:
        scene=lambda w: arguments.benchmark_options(experiment),
        sources=sources_of("flow.benchmark", "flow.benchmark.large_pair"),
    shell:
        "python -m flow.benchmark {params.scene:q} --configs {input.configs:q}"
        " --csv {output.csv:q} --tex {output.tex:q} --figure {output.figure:q}"
        " 2>&1 | tee {log:q}"
