"""The misalignment analysis in images only: flow from render to photo, and warps.

The stages, one rule each: `align` warps photos onto renders, `control_sets` makes what
of a warped test set's gain is no alignment, `decompose` splits a flow into the camera's
part and the rest, `rounds` decides whether another round of warping pays. Their parts:
`estimation` (the flow), `warping` (what is done with it), `camera` (how much of it a
moved camera explains), `figures`, and `benchmark` of the estimators.
"""
