"""Figures of a scene: flow, rounds, parts of the misalignment, crops side by side."""
