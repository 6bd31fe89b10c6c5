"""Cameras that are learnt from photos (BARF, CamP), and how they were exposed.

`refine` learns those of the training views with the scene; `pose_fit` moves one camera
until the finished model's render fits a photo; `exposure` compares photos by the points
that they share; `depths` says how far cameras see without a model, and `lens` what a
wrong lens leaves in the flow.
"""
