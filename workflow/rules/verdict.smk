# What is wrong with a scene, in plain words, after the reference's first round; and
# every photo, with why it stands out. The run says it last (`onsuccess`), so not here.
rule verdict:
    input:
        unpack(lambda w: layout.outputs_of(rows.of_verdict(experiment, w.scene))),
        unpack(lambda w: rows.compared(experiment, w.scene)),
        corrected=lambda w: layout.outputs_of(
            [*rows.corrections(experiment, w.scene).values()]
        ),
        windows=lambda w: rows.files_of_windows(experiment, w.scene),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        poses="results/{scene}/poses.json",
    output:
        verdict="results/{scene}/verdict.json",
        views=report(
            "results/{scene}/tables/views.csv",
            caption="../report/photos.rst",
            category="{scene}",
            labels={"what": "every photo", "kind": "table"},
        ),
    log:
        "results/{scene}/logs/verdict.log",
    benchmark:
        "results/{scene}/logs/verdict.tsv"
    conda:
        "../../environment.yml"
    params:
        base=lambda w: experiment.reference_folder(w.scene, 0),
        options=lambda w: rows.verdict_options(experiment, w.scene),
        sources=sources_of("alignerf.verdict"),
    shell:
        "python -m alignerf.verdict --scene results/{wildcards.scene:q}"
        " --base {params.base:q} {params.options:q} --out {output.verdict:q}"
        " --views {output.views:q} > {log:q} 2>&1"
