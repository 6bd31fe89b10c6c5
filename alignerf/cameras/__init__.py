"""Cameras that are learnt from photos (BARF, CamP), and how they were exposed.

`refine` learns those of the training views with the scene; `moves` tells what all
cameras that were moved have in common; `exposure` compares photos by the points that
they share; `lens` tells a wrong lens from wrong poses.
"""
