"""Gaussian splats of other programs: read from their .ply, and rendered on a CPU.

A judge of blurry models needs renders from the cameras of the photos. A splat's file
is all that many users have; neither a GPU nor its trainer is needed to render it.
This package imports no JAX.
"""
