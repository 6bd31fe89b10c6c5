"""Where images and cameras come from, one module per source.

`courtyard` is embedded and knows its truth; `photos` reads a folder of images,
whose poses `colmap` estimates; `transforms` reads an instant-ngp or nerfstudio
json, `llff` the poses_bounds.npy of LLFF. `prepare` holds what they hand over,
undistorted pinhole views, and brings it to the resolution of training; `distortion`
is what makes views pinhole.
"""
