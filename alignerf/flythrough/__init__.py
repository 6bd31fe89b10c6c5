"""A film of a capture, before and after: a smooth path through its own cameras.

`paths` makes the path, along an ellipse or through the `tours` of the cameras;
`nerfstudio` writes and reads it as `ns-render camera-path` takes it; `rendering` asks
the trained models for its views, and `film` puts them side by side. Two commands:
`python -m alignerf.flythrough.camera_path` for the path, `python -m
alignerf.flythrough` for the film.
"""
