"""Structure from motion with input cameras: matches, their check, bundle adjustment.

Notation: n views by name, their `pixtocams` [n, 3, 3] and `camtoworlds` [n, 3, 4] as in
`scenes.cameras`; a match is a keypoint of each of two views; a track, the keypoints of
several views that matches connect. Nothing here needs JAX or a training.
"""
