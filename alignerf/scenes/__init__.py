"""Views of a scene: photos, cameras, and the folder that all later stages read.

`photos` decodes what people and cameras leave, `photo_names` says whose each is,
`distortion` makes pinhole views of them, `cameras` has the geometry that all share.
`prepare` brings views to the resolution of training and writes them; `prepared` reads
them. `download` fetches a published scene.
"""
