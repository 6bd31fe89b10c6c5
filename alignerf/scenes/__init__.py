"""Where images and cameras come from, one module per source.

`courtyard` is embedded and knows its truth; `photos` reads a folder of images,
whose poses `colmap` estimates; `transforms` reads an instant-ngp or nerfstudio
json, `llff` the poses_bounds.npy of LLFF, `mipnerf360` the folders of 360_v2, `blender`
NeRF's synthetic scenes. `prepare` holds what they hand over,
undistorted pinhole views, and brings it to the resolution of training; `distortion`
is what makes views pinhole. `prepared` is the scene on disk, as all later stages read
it, and `cameras` the geometry that all share. Which sources there are, and which of
them knows its truth, says `alignerf.experiment.keys.scene.SOURCES`: a plan needs that
without importing any of these.
"""
