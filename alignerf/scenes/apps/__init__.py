"""What people have on their disk: folders as apps of phones and COLMAP leave them.

`polycam`, `scanner3d` and `record3d` read an app's folder, each by its own layout;
`phone` holds what they share, and `sources` the list of them. `colmap_models` finds the
model in a COLMAP project, `model_texts` looks through one in text.

Axes: poses of all three apps are ARKit's, camera-to-world with OpenGL axes (x right, y
up, z backwards) of the photo as its rows are stored. Pixel centres: the intrinsics of
ARKit count pixels from the centre of the upper left one (ARCamera.h), ours from its
corner. `scanner3d` writes ARKit's numbers as they are, so half a pixel is added. The
other two scale them to smaller photos in a way that nobody has written down. Their own
and public converters take them from the corner, and so do we: at most half a pixel is
open there.
"""
