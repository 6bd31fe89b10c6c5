"""Several processes, on one host or on many, that train one model.

Each step's rays are shared by all their devices. All compute the same; the first one
alone reads checkpoints and writes files.
"""
