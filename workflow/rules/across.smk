# Tables across scenes: `snakemake table1`.
for table in tables:

    rule:
        name:
            table.name
        input:
            lambda w, t=table: t.inputs,
            configs=lambda w, t=table: t.configs,
            published=local(table.published),
        output:
            csv=report(
                f"results/{table.name}.csv",
                caption=f"../report/{table.kind}.rst",
                category=table.name,
                labels={"what": table.name, "kind": "table"},
            ),
            tex=f"results/{table.name}.tex",
            provenance=f"results/{table.name}.provenance.json",
            beside=[
                report(
                    f"results/{table.name}{end}",
                    caption=f"../report/{table.kind}.rst",
                    category=table.name,
                    labels={"what": table.name, "kind": kind},
                )
                for kind, end in table.beside.items()
            ],
        log:
            f"results/logs/{table.name}.log",
        benchmark:
            f"results/logs/{table.name}.tsv"
        # Narrowed by the words of the command line, which a job elsewhere has not.
        localrule: True
        conda:
            "../../environment.yml"
        params:
            command=lambda w, t=table: t.command,
            sources=sources.sources_of("alignerf.tabulate"),
        shell:
            RUN


# What `snakemake --list` says of them: each its own.
for table in tables:
    workflow.get_rule(table.name).docstring = table.about
