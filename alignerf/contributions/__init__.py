"""AligNeRF's three contributions (CVPR 2023, arXiv 2211.09682).

1. `patch_conv`: features of a patch through three convolutions to RGB; over whole
   images in `strips`.
2. `align_loss`: L_PM, a rendered patch against the photo patch nearest to it (Eq. 4);
   `aligned_loss`: the same on single rays.
3. `frequency_loss`: the high-frequency loss on features of the aligned patch.
"""
