"""The page that a run ends in: `results/<scene>/index.html`, one file without network.

`told` has the verdict and its gauges, `contents` tables and links, `gallery` every
photo and its layers, `rig` the cameras in space, `matched` the worst pair's matches;
`pictures` makes images fit.
`template.html` includes the other .html, .css and .js, a part of the page each.
`vendor/` has the slider and the sortable tables, as their authors publish them.
"""
