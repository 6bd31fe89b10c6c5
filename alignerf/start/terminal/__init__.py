"""A run on the terminal: a line for each job, and how long it will still take.

`events` starts the workflow and yields what happens; `jobs` names a job for a reader;
`screen` writes lines and the bar; `report` puts them together. All that Snakemake and
its jobs print goes to a file, which is named.
"""
