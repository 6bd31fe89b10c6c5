# Photos of the paper's scenes, and weights, where they are not there: what a user has put
# there is no rule's output, and so is never deleted or fetched again.
rule download_360_v2:
    output:
        [directory(local(path)) for path in fetched.scenes()],
    log:
        "results/logs/download_360_v2.log",
    conda:
        "../../environment.yml"
    params:
        folder=lambda w: fetched.folder(),
    shell:
        "python -m alignerf.scenes.download {params.folder:q} 2>&1 | tee {log:q}"


for weights_path, network in fetched.weights().items():

    rule:
        name:
            f"download_{network}_weights"
        output:
            local(weights_path),
        log:
            f"results/logs/download_{network}_weights.log",
        conda:
            "../../environment.yml"
        params:
            network=network,
        shell:
            "python -m alignerf.networks.weights {params.network:q} --out {output:q}"
            " 2>&1 | tee {log:q}"
