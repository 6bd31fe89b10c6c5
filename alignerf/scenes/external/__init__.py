"""What another program has trained, to be judged: photos, its renders, its cameras.

`renders` and `depths` find its files, `lenses` reads its cameras, `geometry` tells how
a photo became the picture that a render shows, `views` puts all together.
"""
