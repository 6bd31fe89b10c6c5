# A smooth path through a capture's own cameras, as nerfstudio reads it.
rule camera_path:
    input:
        cameras="results/{scene}/cameras.npz",
        poses="results/{scene}/poses.json",
    output:
        "results/{scene}/camera_path.json",
    log:
        "results/{scene}/logs/camera_path.log",
    benchmark:
        "results/{scene}/logs/camera_path.tsv"
    conda:
        "../../environment.yml"
    params:
        sources=sources_of("alignerf.flythrough.camera_path"),
    shell:
        "python -m alignerf.flythrough.camera_path --scene results/{wildcards.scene:q}"
        " --out {output:q} 2>&1 | tee {log:q}"


# A film along it, before and after. Its frames lie outside of `output:`, which Snakemake
# deletes when a job is killed: a film resumes.
rule flythrough_scene:
    input:
        lambda w: sides.files(experiment, w.scene),
        path="results/{scene}/camera_path.json",
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
        decisions=lambda w: inputs.decisions_of(experiment, w.scene),
    output:
        "results/{scene}/flythrough.webm",
    log:
        "results/{scene}/logs/flythrough.log",
    benchmark:
        "results/{scene}/logs/flythrough.tsv"
    conda:
        "../../environment.yml"
    threads: sources.WHOLE_MACHINE
    resources:
        gpu=sources.ACCELERATORS,
        mem_mb=needs.usual_mb,
    params:
        sides=lambda w: sides.option(experiment, w.scene),
        frames=subpath(output[0], strip_suffix=".webm"),
        sources=sources_of("alignerf.flythrough"),
    shell:
        "python -m alignerf.flythrough --scene results/{wildcards.scene:q}"
        " --camera-path {input.path:q} --sides {params.sides:q}"
        " --frames {params.frames:q}_frames --out {output:q} --threads {threads} 2>&1"
        " | tee {log:q}"


rule flythrough:
    input:
        sides.films(experiment),
