"""Training: from a job to parameters.

`compose` makes a job's method, one of `methods`; `program` compiles its `step`, which
draws `batches` and takes `gradients`, to fit the `memory`. `loop` begins a `run`, makes
its steps and saves `checkpoint`s; `diagnose` says why a step is not finite. `renderer`
makes images of what was trained.
"""
