"""The sources of images and cameras, one module each.

`courtyard` is embedded and knows its truth; `photos` reads a folder of images,
whose poses `colmap` estimates; `transforms` reads an instant-ngp or nerfstudio
json, `llff` the poses_bounds.npy of LLFF, `mipnerf360` the folders of 360_v2, `blender`
NeRF's synthetic scenes; `apps` has folders of phones' apps. `distortion` turns photos
into pinhole views; `prepare` brings these to the resolution of training and writes
them. `prepared` is the scene on disk, as all later stages read it, and `cameras` the
geometry that all share. The list of sources
is `alignerf.experiment.keys.scene.SOURCES`: a plan needs it without importing these.
"""
