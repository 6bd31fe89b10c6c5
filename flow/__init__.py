"""The misalignment analysis: flow from render to photo, warps, and the flow's causes.

No JAX: images, depth and cameras are read from files. The stages: `align` warps photos
onto renders, `control_sets` makes the controls of a warped test set, `decompose` splits
a flow into the camera's part and the rest, `rounds` decides whether another round of
warping pays. They use `estimation` of the flow, `warping` by it, its explanation by a
moved `camera`, and `figures`; `benchmark` compares the estimators.
"""
