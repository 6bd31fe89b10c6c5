# Scenes that are judged: photos beside the renders of another program. Nothing is
# trained; from the flow on, all is as of our own renders.
rule judged:
    input:
        images="results/{scene}/images",
        cameras="results/{scene}/cameras.npz",
    output:
        timing="results/{scene}/{training}/timing.json",
        learnt=directory("results/{scene}/{training}/learnt"),
        renders=directory("results/{scene}/{training}/renders"),
        depth=directory("results/{scene}/{training}/depth"),
        time=directory("results/{scene}/{training}/render"),
    log:
        "results/{scene}/{training}/logs/render.log",
    benchmark:
        "results/{scene}/{training}/logs/render.tsv"
    wildcard_constraints:
        scene=plan.one_of(experiment.judged()),
        training=plan.trained_by(experiment, external=True),
    conda:
        "../../environment.yml"
    threads: sources.WHOLE_MACHINE
    params:
        splits=lambda w: experiment.splits(w.scene, w.training),
        sources=sources_of("alignerf.others.render"),
    shell:
        "python -m alignerf.others.render --scene results/{wildcards.scene:q}"
        " --splits {params.splits} --cores {threads}"
        " --renders {output.renders:q}/{{split}} --depth {output.depth:q}/{{split}}"
        " --timing {output.time:q}/{{split}}.json --learnt {output.learnt:q}"
        " --trained {output.timing:q} 2>&1 | tee {log:q}"


# What the estimator invents where nothing is displaced: of judged scenes, which have no
# test sets.
rule overfit:
    input:
        renders="results/{scene}/{training}/renders",
        photos="results/{scene}/images",
        flow="results/{scene}/{training}/flow",
    output:
        "results/{scene}/{training}/overfit.csv",
    log:
        "results/{scene}/{training}/logs/overfit.log",
    benchmark:
        "results/{scene}/{training}/logs/overfit.tsv"
    conda:
        "../../environment.yml"
    threads: sources.WHOLE_MACHINE
    params:
        flow=arguments.estimator_options(experiment),
        split=lambda w: experiment.splits(w.scene, w.training)[0],
        sources=sources_of("flow.control_sets"),
    shell:
        "python -m flow.control_sets {params.flow:q} --threads {threads}"
        " --renders {input.renders:q}/{params.split}"
        " --photos {input.photos:q} --masks {input.photos:q}/masks"
        " --flow {input.flow:q}/{params.split} --lengths {output:q} 2>&1 | tee {log:q}"
