"""AligNeRF (CVPR 2023) and its baseline mip-NeRF 360 in JAX."""
