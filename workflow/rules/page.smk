# What a visitor opens: verdict, images, tables and costs of a scene in one file.
rule page:
    input:
        unpack(lambda w: pages.files(experiment, w.scene)),
        lambda w: rows.shown_in(rows.figure_rounds(experiment, w.scene)),
        windows=lambda w: pages.of_windows(experiment, w.scene),
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        preflight=lambda w: targets.preflight_of(experiment, w.scene),
        tables=lambda w: targets.of_page(experiment, w.scene),
    output:
        report(
            "results/{scene}/index.html",
            caption="../report/page.rst",
            category="{scene}",
            # Labels are sorted: this one comes first.
            labels={"what": "1. the page", "kind": "page"},
        ),
    log:
        "results/{scene}/logs/page.log",
    benchmark:
        "results/{scene}/logs/page.tsv"
    conda:
        "../../environment.yml"
    params:
        rounds=lambda w: rows.as_json(rows.figure_rounds(experiment, w.scene)),
        base=lambda w: experiment.reference_folder(w.scene, 0),
        options=lambda w: pages.options(experiment, w.scene),
        sources=sources_of("alignerf.page"),
    shell:
        "python -m alignerf.page --scene results/{wildcards.scene:q}"
        " --rounds {params.rounds:q} --base {params.base:q} {params.options:q}"
        " --out {output:q}"
        " 2>&1 | tee {log:q}"
