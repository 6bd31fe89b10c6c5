# Photos of the paper's scenes, and weights, where they are not there: what a user has put
# there is no rule's output, and so is never deleted or fetched again. Each scene is a job
# of its own, since a failing job loses its outputs; one at a time, since they share an
# archive. On a cluster where Snakemake runs: nodes may have no network.
missing_scenes = check.or_exit(fetched.scenes)


rule download_360_v2:
    input:
        local(missing_scenes),
    localrule: True


for scene_path in missing_scenes:

    rule:
        name:
            f"download_360_v2_{scene_path.rpartition('/')[2]}"
        output:
            directory(local(scene_path)),
        log:
            f"results/logs/download_360_v2/{scene_path.rpartition('/')[2]}.log",
        localrule: True
        conda:
            "../../environment.yml"
        threads: 10_000  # all that there are
        shell:
            "python -m alignerf.scenes.download {output:q} 2>&1 | tee {log:q}"


for weights_path, network in fetched.weights().items():

    rule:
        name:
            f"download_{network}_weights"
        output:
            local(weights_path),
        log:
            f"results/logs/download_{network}_weights.log",
        localrule: True
        conda:
            "../../environment.yml"
        params:
            network=network,
        shell:
            "python -m alignerf.networks.weights {params.network:q} --out {output:q}"
            " 2>&1 | tee {log:q}"
