"""What another program has trained, to be judged: photos, its renders, its cameras.

`renders` and `depths` find its files, `camera_files` reads its cameras, `geometry`
tells how a photo became the picture that a render shows, `views` puts all together.
`originals` notes what files a scene was made of.
"""
