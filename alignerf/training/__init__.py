"""Training: from a job to parameters.

`compose` makes a job's method, one of `methods`; `program` compiles its `step`, which
draws `batches` and takes `gradients`; `loop` runs it from `checkpoint` to `checkpoint`.
`memory` and `devices` fit it to the machine; `diagnose` says why a step is not finite.
"""
