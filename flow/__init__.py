"""The misalignment analysis: flow from render to photo, warps, what it is made of.

No JAX: images, depth and cameras are read from files. The stages: `align` warps photos
onto renders, `control_sets` makes what of a warped test set's gain is no alignment,
`decompose` splits a flow into the camera's part and the rest, `rounds` decides whether
another round of warping pays. Their parts: `estimation` (the flow), `warping` (what is
done with it), `camera` (how much of it a moved camera explains), `figures`, and
`benchmark` of the estimators.
"""
