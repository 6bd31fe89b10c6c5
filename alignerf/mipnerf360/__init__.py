"""mip-NeRF 360 as published (arXiv 2111.12077).

Knows rays, step functions and fields; no patches, files or alignment.
"""
