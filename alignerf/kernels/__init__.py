"""Kernels in C++ for what XLA does slowly on a CPU: optional, and each has a twin.

XLA makes some six hundred small programs of a training step, which hand arrays to one
another through memory. The look-ups of a hash grid, the resampling along rays, the
proposals' loss and Adam on a table are loops that keep what they need in a core's
caches. The twin of each, in JAX, is what runs elsewhere: on a GPU, where no C++
compiler is, and where `training.kernels` says so. Both agree to rounding.
"""
