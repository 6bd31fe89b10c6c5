"""What is wrong with a scene, what to do, and how sure that is.

`views` measures each photo against the render of its view, `evidence` sums that up,
`causes` decides by named thresholds, `words` says it.
"""
