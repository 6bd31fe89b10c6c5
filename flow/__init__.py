"""The misalignment analysis in images only: flow from render to photo, and warps."""
