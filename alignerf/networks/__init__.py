"""Published networks with fixed weights, without PyTorch.

VGG-19's first block is in `convnet`, of which the `backbones` of LPIPS are built;
`tools.convert_weights` makes their .npz from the published files.
"""
