"""What is wrong with a scene, what to do, and how sure that is.

`views` measures each photo against the render of its view, `evidence` sums that up,
`alignerf.causes` decides by named thresholds, `report` says it.
"""
