# Metrics per test view and test set.
rule evaluate:
    input:
        unpack(lambda w: rows.truth_of(experiment, w.scene)),
        renders="results/{scene}/{method}/round{round}/renders/test",
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        flow="results/{scene}/testset/flow",
        warped="results/{scene}/testset/warped",
        controls=[f"results/{{scene}}/testset/{name}" for name in flows.CONTROL_SETS],
        weights=list(config["lpips"].values()),
    output:
        "results/{scene}/{method}/round{round}/metrics.csv",
    log:
        "results/{scene}/{method}/round{round}/logs/evaluate.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/evaluate.tsv"
    conda:
        "../../environment.yml"
    params:
        testset=lambda w: flows.option("testset", f"results/{w.scene}/testset"),
        truth=lambda w, input: flows.option("truth", input.get("truth")),
        lpips=flows.lpips_options(experiment),
        sources=sources_of("alignerf.evaluate"),
    shell:
        "python -m alignerf.evaluate --scene results/{wildcards.scene:q}"
        " --renders {input.renders:q} {params.testset:q} {params.truth:q}"
        " {params.lpips:q} --metrics {output:q} 2>&1 | tee {log:q}"
