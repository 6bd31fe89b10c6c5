# Photos of the paper's scenes that are missing. What a user has put there is no rule's
# output, so it is never deleted or downloaded again. Each scene is a job of its own,
# since a failing job loses its outputs; one at a time, since they share an archive. On a
# cluster they run where Snakemake does: nodes may have no network.
missing_scenes = check.or_exit(fetched.scenes)


rule download_360_v2:
    """Download the nine scenes of mip-NeRF 360 into 360_v2/ (17 GB)"""
    input:
        local(missing_scenes),
    localrule: True


rule download_scene:
    """Download one scene of mip-NeRF 360"""
    output:
        directory(local(f"{fetched.folder()}/{{capture}}")),
    log:
        "results/logs/download_360_v2/{capture}.log",
    wildcard_constraints:
        capture=plan.one_of(one.rpartition("/")[2] for one in missing_scenes),
    localrule: True
    conda:
        "../../environment.yml"
    threads: 10_000  # all that there are
    shell:
        "python -m alignerf.scenes.download {output:q} 2>&1 | tee {log:q}"
