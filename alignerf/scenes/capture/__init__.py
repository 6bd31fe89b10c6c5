"""Folders of photos as people have them: any orientation, HEIC, video.

`ingest` goes through the folder, `orientation` finds how photos of one sensor lie
alike, `video` chooses the frames of a video, `canvas` lays photos of several sizes on
one. `mapping` is COLMAP's own work, and `vocabulary` finds photos that look alike for
it. What a single file holds, decodes `alignerf.scenes.photos`.
"""
