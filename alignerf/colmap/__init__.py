"""Poses of photos by COLMAP, and folders of photos as people have them.

`ingest` goes through a folder and finds how photos of one sensor lie alike, `video`
chooses the frames of a film, `canvas` lays photos of several sizes on one. `mapping` is
COLMAP's own work, `structure` what it comes to; `triangulate` adds points to poses that
are known. `loading` and `crops` read views once more at the photos' own size.
"""
