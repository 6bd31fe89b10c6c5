"""What people have in a folder: photos of any orientation, HEIC, video.

`ingest` goes through the folder, `orientation` finds how photos of one sensor lie
alike, `video` chooses the frames of a film, and `vocabulary` finds photos that look
alike. What a single file holds, decodes `alignerf.scenes.photos`.
"""
