# The run says the verdict last (`onsuccess`), so not here.
rule verdict:
    """Diagnose a scene from its renders, flow and scores"""
    input:
        unpack(step.verdict.inputs),
    output:
        verdict=scene.verdict,
        views=report(
            scene.views,
            caption="../report/photos.rst",
            category="{scene}",
            labels={"what": "every photo", "kind": "table"},
        ),
        transients=scene.transients,
    log:
        scene.log("verdict"),
    benchmark:
        scene.benchmark("verdict")
    conda:
        "../../environment.yml"
    params:
        command=step.verdict.command,
        sources=step.verdict.sources,
    shell:
        "python -m {params.command:q} > {log:q} 2>&1"


rule page:
    """Write a scene's page, one HTML file"""
    input:
        unpack(step.page.inputs),
    output:
        report(
            scene.page,
            caption="../report/page.rst",
            category="{scene}",
            # Labels are sorted: this one comes first.
            labels={"what": "1. the page", "kind": "page"},
        ),
    log:
        scene.log("page"),
    benchmark:
        scene.benchmark("page")
    conda:
        "../../environment.yml"
    params:
        command=step.page.command,
        sources=step.page.sources,
    shell:
        RUN


# Folders for other programs: photos as taken (`cameras`), or as the last round was
# trained on them (`photos`).
rule export_folder:
    """Write one method's photos and cameras for other programs"""
    input:
        unpack(step.export_folder.inputs),
    output:
        # What users and their programs have put into it stays.
        update(directory(scene.export("{method}", "{what}"))),
    log:
        f"{scene}/{{method}}/logs/export_{{what}}.log",
    benchmark:
        f"{scene}/{{method}}/logs/export_{{what}}.tsv"
    wildcard_constraints:
        what="cameras|photos",
    conda:
        "../../environment.yml"
    threads: step.export_folder.threads
    params:
        command=step.export_folder.command,
        sources=step.export_folder.sources,
    shell:
        RUN


rule export:
    """Write photos, cameras and points for nerfstudio, Gaussian splatting and COLMAP"""
    input:
        lambda w: check.or_exit(targets.of_exports, experiments),
