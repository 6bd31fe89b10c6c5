# Poses are computed once and kept: no later rule changes them.
rule poses:
    """Prepare a scene's photos and cameras"""
    input:
        unpack(step.poses.inputs),
    output:
        images=directory(scene.images),
        cameras=scene.cameras,
        report=scene.poses,
    log:
        scene.log("poses"),
    benchmark:
        scene.benchmark("poses")
    conda:
        "../../environment.yml"
    threads: step.poses.threads
    resources:
        mem_mb=cluster.usual_mb,
    params:
        command=step.poses.command,
        sources=step.poses.sources,
    shell:
        RUN


# Jobs take those of the decisions that the config leaves to them.
rule facts:
    """Measure a scene and decide the settings that the config leaves open"""
    input:
        unpack(step.facts.inputs),
    output:
        facts=scene.facts,
        decisions=scene.decisions,
    log:
        scene.log("facts"),
    benchmark:
        scene.benchmark("facts")
    conda:
        "../../environment.yml"
    params:
        command=step.facts.command,
        sources=step.facts.sources,
    shell:
        RUN


rule config:
    """Write a scene's complete config, defaults included"""
    output:
        scene.config,
    log:
        scene.log("config"),
    benchmark:
        scene.benchmark("config")
    conda:
        "../../environment.yml"
    params:
        command=step.config.command,
        sources=step.config.sources,
    shell:
        RUN
