# Cameras and photos for other programs, as nerfstudio and COLMAP read them.
rule export_cameras:
    input:
        verdict=lambda w: rows.verdict_of(experiment, w.scene, w.method),
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
        # Where aligning on the way brought nothing, cameras go out as given.
        paid=lambda w, input: ["--if-pays", input.verdict, w.method]
        * bool(input.verdict),
        sources=sources_of("alignerf.export"),
    shell:
        "python -m alignerf.export --scene results/{wildcards.scene:q}"
        " --cameras {input.used:q} {params.warped:q} {params.paid:q} --out {output:q} 2>&1 | tee {log:q}"


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
        verdict=lambda w: rows.verdict_of(experiment, w.scene, w.method),
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
