# Tables of all scenes of a config, or of its sweep: `snakemake remedies` and others.
for table in across.every(experiment):

    rule:
        name:
            table.name
        input:
            lambda w, made=table.rows: rows.files_of(check.or_exit(made, experiment)),
            configs=lambda w, made=table.configs: check.or_exit(made, experiment),
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
                labels={"what": f"{table.name}: {table.beside[0]}", "kind": "more"},
            ),
        log:
            f"results/logs/{table.name}.log",
        benchmark:
            f"results/logs/{table.name}.tsv"
        conda:
            "../../environment.yml"
        params:
            rows=lambda w, made=table.rows: rows.as_json(made(experiment)),
            options=table.options,
            beside=f"--{table.beside[0]}",
            module=f"alignerf.tables.{table.name}",
            sources=sources_of(f"alignerf.tables.{table.name}"),
        shell:
            "python -m {params.module} --rows {params.rows:q} {params.options:q}"
            " --configs {input.configs:q} --csv {output.csv:q} --tex {output.tex:q}"
            " {params.beside} {output.beside:q} 2>&1 | tee {log:q}"
