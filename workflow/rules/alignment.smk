rule align:
    """Estimate the flow from renders to photos and warp the photos by it"""
    input:
        unpack(step.align.inputs),
    output:
        flow=directory(training.flow),
        warped=directory(training.warped),
        stats=directory(training.displacement),
    log:
        training.log("align"),
    benchmark:
        training.benchmark("align")
    conda:
        "../../environment.yml"
    threads: step.align.threads
    params:
        command=step.align.command,
        sources=step.align.sources,
    shell:
        RUN_IN_THREADS


rule testset:
    """Warp the test photos onto the reference model's renders"""
    input:
        unpack(step.testset.inputs),
    output:
        flow=directory(scene.testset_flow),
        warped=directory(scene.testset_warped),
        stats=scene.testset_lengths,
    log:
        f"{scene.testset}/logs/align.log",
    benchmark:
        f"{scene.testset}/logs/align.tsv"
    conda:
        "../../environment.yml"
    params:
        command=step.testset.command,
        sources=step.testset.sources,
    shell:
        RUN


rule control_sets:
    """Make test sets that show what warping gains without alignment"""
    input:
        unpack(step.control_sets.inputs),
    output:
        [directory(path) for path in steps.trainings.control_folders(scene)],
        lengths=scene.testset_overfit,
    log:
        f"{scene.testset}/logs/control_sets.log",
    benchmark:
        f"{scene.testset}/logs/control_sets.tsv"
    conda:
        "../../environment.yml"
    params:
        command=step.control_sets.command,
        sources=step.control_sets.sources,
    shell:
        RUN


rule overfit:
    """Measure the flow that the estimator invents between equal images"""
    input:
        unpack(step.overfit.inputs),
    output:
        training.overfit,
    log:
        training.log("overfit"),
    benchmark:
        training.benchmark("overfit")
    conda:
        "../../environment.yml"
    threads: step.overfit.threads
    params:
        command=step.overfit.command,
        sources=step.overfit.sources,
    shell:
        RUN_IN_THREADS


rule correct_poses:
    """Correct cameras by the flow between renders and photos"""
    input:
        unpack(step.correct_poses.inputs),
    output:
        cameras=training.corrected,
        report=training.corrections,
    log:
        training.log("correct_poses"),
    benchmark:
        training.benchmark("correct_poses")
    conda:
        "../../environment.yml"
    threads: step.correct_poses.threads
    params:
        command=step.correct_poses.command,
        sources=step.correct_poses.sources,
    shell:
        RUN_IN_THREADS


rule decompose:
    """Split the flow into camera error and the rest"""
    input:
        unpack(step.decompose.inputs),
    output:
        parts=directory(training.parts("{split}", "{photos}")),
        stats=training.decomposition("{split}", "{photos}"),
    log:
        training.log("decompose{photos}_{split}"),
    benchmark:
        training.benchmark("decompose{photos}_{split}")
    wildcard_constraints:
        photos="|_photos",
    conda:
        "../../environment.yml"
    threads: step.decompose.threads
    params:
        command=step.decompose.command,
        sources=step.decompose.sources,
    shell:
        RUN_IN_THREADS
