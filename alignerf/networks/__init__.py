"""Published networks with fixed weights, without PyTorch.

VGG-19's first block is in `convnet`, of which the `backbones` of LPIPS are built;
`weights` makes their .npz from the published files, which `torch_files` reads.
"""
