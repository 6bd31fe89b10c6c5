"""What the systems are made of, and what a ray shows by NeRF, mip-NeRF and NeRF++.

A system's `made` is given this package. Its own file imports none of it: a plan does
not wait for JAX, and what only reads keys does not run again when a network changes.
"""

from alignerf import fields
from alignerf.fields import box, encoding, radiance
from alignerf.mipnerf360 import model as mipnerf360
from alignerf.rays import mipnerf, nerf, nerfpp, rendering, sampling

__all__ = ["box", "encoding", "fields", "mipnerf", "mipnerf360", "nerf", "nerfpp"]
__all__ += ["radiance", "rendering", "sampling"]
