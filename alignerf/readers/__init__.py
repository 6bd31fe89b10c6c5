"""Files of cameras as programs and apps write them: a reader makes `Cameras` of each.

`shots` has what all share: `Cameras`, the photo of each, and the views of both.
`projects` are folders of COLMAP's kind; `programs` has what is not of NeRF's own world.
"""
