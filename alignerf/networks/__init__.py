"""Published networks with fixed weights, without PyTorch.

`vgg19` and the `backbones` of LPIPS are built of `convnet`; `weights` makes their .npz
from the published files, which `torch_files` reads.
"""
