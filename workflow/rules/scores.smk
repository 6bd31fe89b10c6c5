rule align_test_poses:
    """Align the cameras of test views to a trained model and render them"""
    input:
        unpack(step.align_test_poses.inputs),
    output:
        directory(training.aligned_pose),
    log:
        training.log("align_test_poses"),
    benchmark:
        training.benchmark("align_test_poses")
    conda:
        "../../environment.yml"
    threads: step.align_test_poses.threads
    resources:
        gpu=step.align_test_poses.gpu,
        mem_mb=cluster.usual_mb,
        runtime=cluster.minutes,
    params:
        command=step.align_test_poses.command,
        sources=step.align_test_poses.sources,
    shell:
        RUN_ON_DEVICES


rule evaluate:
    """Score the renders of a round on every test set"""
    input:
        unpack(step.evaluate.inputs),
    output:
        f"{training}/metrics{{moved}}.csv",
    log:
        training.log("evaluate{moved}"),
    benchmark:
        training.benchmark("evaluate{moved}")
    wildcard_constraints:
        moved="|_aligned_pose",
    conda:
        "../../environment.yml"
    params:
        command=step.evaluate.command,
        sources=step.evaluate.sources,
    shell:
        RUN


# Of a scene's tables, or of one across scenes.
rule collect:
    """Collect scores and training costs for the tables"""
    input:
        unpack(step.collect.inputs),
    output:
        scores=scene.scores("{table}"),
        trainings=scene.trainings("{table}"),
    log:
        scene.log("{table}collect"),
    benchmark:
        scene.benchmark("{table}collect")
    wildcard_constraints:
        table="|".join(["", *(f"{table}/" for table in scenes.OF_TABLES)]),
    conda:
        "../../environment.yml"
    params:
        command=step.collect.command,
        sources=step.collect.sources,
    shell:
        RUN


rule tables:
    """Make one of a scene's tables as CSV and LaTeX"""
    input:
        unpack(step.tables.inputs),
    output:
        report(
            scene.table("{table}"),
            caption="../report/tables.rst",
            category="{scene}",
            labels={"what": "{table}", "kind": "table"},
        ),
        tex=scene.table("{table}", "tex"),
        provenance=scene.table("{table}", "provenance.json"),
    log:
        scene.log("{table}_table"),
    benchmark:
        scene.benchmark("{table}_table")
    wildcard_constraints:
        table="|".join(targets.tables(known=True)),
    conda:
        "../../environment.yml"
    params:
        command=step.tables.command,
        sources=step.tables.sources,
    shell:
        RUN


rule draw:
    """Draw the figures of a scene"""
    input:
        unpack(step.draw.inputs),
    output:
        [
            report(
                scene.figure(figure),
                caption=f"../report/{figure}.rst",
                category="{scene}",
                labels={"what": figure, "kind": "figure"},
            )
            for figure in targets.FIGURES
        ],
    log:
        scene.log("draw"),
    benchmark:
        scene.benchmark("draw")
    conda:
        "../../environment.yml"
    params:
        command=step.draw.command,
        sources=step.draw.sources,
    shell:
        RUN
