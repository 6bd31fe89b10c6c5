"""Networks that stay as they are published, without PyTorch: what sees with them.

`vgg19` and the `backbones` of LPIPS are built of `convnet`; `weights` makes their .npz
from the published files, which `torch_files` reads.
"""
