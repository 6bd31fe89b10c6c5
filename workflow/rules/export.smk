# Folders for other programs: photos as taken, or as the last round was trained on them.
rule export_photos:
    input:
        unpack(lambda w: inputs.of_export(experiment, w.scene, w.method, w.what)),
        images="results/{scene}/images",
        poses="results/{scene}/poses.json",
        cameras="results/{scene}/cameras.npz",
    output:
        # What users and their programs have put into it stays.
        update(directory("results/{scene}/{method}/export/{what}")),
    log:
        "results/{scene}/{method}/logs/export_{what}.log",
    benchmark:
        "results/{scene}/{method}/logs/export_{what}.tsv"
    wildcard_constraints:
        what="photos",
    conda:
        "../../environment.yml"
    threads: sources.WHOLE_MACHINE
    params:
        options=lambda w: inputs.export_options(experiment, w.scene, w.method, w.what),
        sources=sources_of("alignerf.export"),
    shell:
        "python -m alignerf.export --scene results/{wildcards.scene:q}"
        " {params.options:q} --out {output:q} 2>&1 | tee {log:q}"


# Cameras are what a user wants first.
use rule export_photos as export_cameras with:
    wildcard_constraints:
        what="cameras",
    priority: 1


rule export:
    input:
        lambda w: targets.exports(experiment),
