# Cameras and photos for other programs, as nerfstudio and COLMAP read them.
rule export_cameras:
    input:
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        used=lambda w: experiment.rendered_with(
            w.scene, w.method, experiment.last_round(w.scene, w.method)
        ),
    output:
        directory("results/{scene}/{method}/export/cameras"),
    log:
        "results/{scene}/{method}/logs/export_cameras.log",
    benchmark:
        "results/{scene}/{method}/logs/export_cameras.tsv"
    conda:
        "../../environment.yml"
    params:
        warped=[],
        sources=sources_of("alignerf.export"),
    shell:
        "python -m alignerf.export --scene results/{wildcards.scene:q}"
        " --cameras {input.used:q} {params.warped:q} --out {output:q} 2>&1 | tee {log:q}"


# The same with the warped photos that the last round was trained on.
use rule export_cameras as export_photos with:
    input:
        unpack(
            lambda w: rows.photos_learnt(
                experiment,
                w.scene,
                w.method,
                experiment.last_round(w.scene, w.method),
            )
        ),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        used=lambda w: experiment.rendered_with(
            w.scene, w.method, experiment.last_round(w.scene, w.method)
        ),
    output:
        directory("results/{scene}/{method}/export/photos"),
    log:
        "results/{scene}/{method}/logs/export_photos.log",
    benchmark:
        "results/{scene}/{method}/logs/export_photos.tsv"
    params:
        warped=lambda w, input: ["--warped", input.photos, "--valid", input.valid],


rule export:
    input:
        lambda w: targets.exports(experiment),
