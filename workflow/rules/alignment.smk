# Optical flow from render to photo, and the photos warped onto the renders. Always
# from the original photo, so that nothing compounds over the rounds.
rule align:
    input:
        renders="results/{scene}/{method}/round{round}/renders/{split}",
        photos="results/{scene}/images",
    output:
        flow=directory("results/{scene}/{method}/round{round}/flow/{split}"),
        warped=directory("results/{scene}/{method}/round{round}/warped/{split}"),
        stats="results/{scene}/{method}/round{round}/displacement_{split}.csv",
    log:
        "results/{scene}/{method}/round{round}/logs/align_{split}.log",
    benchmark:
        "results/{scene}/{method}/round{round}/logs/align_{split}.tsv"
    conda:
        "../../environment.yml"
    params:
        flow=lambda w: flow_options(w.scene, w.method, w.round, w.split),
        sources=sources_of("flow.align"),
    shell:
        "python -m flow.align {params.flow:q} --renders {input.renders:q}"
        " --photos {input.photos:q} --flow-out {output.flow:q}"
        " --warped-out {output.warped:q} --stats-out {output.stats:q}"
        " 2>&1 | tee {log:q}"


# The warped test set: made once, by the reference model, for all methods.
rule testset:
    input:
        renders=lambda w: "{}/renders/test".format(
            trained(
                w.scene, config["reference"]["method"], config["reference"]["round"]
            )
        ),
        photos="results/{scene}/images",
    output:
        flow=directory("results/{scene}/testset/flow"),
        warped=directory("results/{scene}/testset/warped"),
        control=directory("results/{scene}/testset/control"),
        stats="results/{scene}/testset/displacement.csv",
    log:
        "results/{scene}/testset/logs/align.log",
    benchmark:
        "results/{scene}/testset/logs/align.tsv"
    conda:
        "../../environment.yml"
    params:
        flow=lambda w: flow_options(
            w.scene,
            config["reference"]["method"],
            config["reference"]["round"],
            "test",
        ),
        sources=sources_of("flow.align"),
    shell:
        "python -m flow.align {params.flow:q} --renders {input.renders:q}"
        " --photos {input.photos:q} --flow-out {output.flow:q}"
        " --warped-out {output.warped:q} --control-out {output.control:q}"
        " --stats-out {output.stats:q} 2>&1 | tee {log:q}"
