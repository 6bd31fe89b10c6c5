"""The page that a run ends in: `results/<scene>/index.html`, one file without network.

`contents` says what stands in it, `pictures` makes the images that it holds, and
`template.html`, `style.css` and `page.js` give it its looks. `vendor/` has the slider
and the sortable tables, as their authors publish them.
"""
