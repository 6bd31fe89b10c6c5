# Tables across scenes: `snakemake remedies`.
for table in scenes.across(experiment):

    rule:
        name:
            table.name
        input:
            lambda w, made=table.inputs: made(experiment),
            configs=lambda w, made=table.configs: made(experiment),
            published=local(table.published),
        output:
            csv=report(
                f"results/{table.stem}.csv",
                caption=f"../report/{table.name}.rst",
                category=table.name,
                labels={"what": table.name, "kind": "table"},
            ),
            tex=f"results/{table.stem}.tex",
            provenance=f"results/{table.stem}.provenance.json",
            beside=report(
                f"results/{table.stem}{table.beside[1]}",
                caption=f"../report/{table.name}.rst",
                category=table.name,
                labels={"what": table.name, "kind": table.beside[0]},
            ),
        log:
            f"results/logs/{table.name}.log",
        benchmark:
            f"results/logs/{table.name}.tsv"
        conda:
            "../../environment.yml"
        params:
            options=lambda w, made=table.options: made(experiment),
            beside=f"--{table.beside[0]}",
            module=table.module,
            sources=sources.sources_of(table.module),
        shell:
            "python -m {params.module} {params.options:q} --configs {input.configs:q}"
            " --csv {output.csv:q} --tex {output.tex:q} {params.beside}"
            " {output.beside:q} 2>&1 | tee {log:q}"


# What `snakemake --list` says of them: each its own.
for table in scenes.across(experiment):
    workflow.get_rule(table.name).docstring = table.about
