"""Several processes, on one host or on many, that train one model.

All processes compute the same step, whose rays their `devices` share. They meet and
agree by `consensus`; the first alone reads checkpoints and writes files.
"""
