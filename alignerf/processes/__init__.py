"""Several processes, on one host or on many, that train one model.

All processes compute the same step, whose rays their `devices` share. Each process has
a `rank`; the first alone reads checkpoints and writes files. They meet in `rendezvous`
and agree by `consensus`.
"""
