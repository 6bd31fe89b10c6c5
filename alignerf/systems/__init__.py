"""Systems of other papers, composed of the same parts, each as short as its method.

`nerf`, `mipnerf`, `nerfpp`, `instant_ngp` are what the paper compares with; they share
`sampling` and `rendering`.
"""
