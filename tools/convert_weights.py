"""Weights of the fixed networks as .npz, made with PyTorch:

    pip install torch numpy
    python -m tools.convert_weights WHAT --out FILE

WHAT is `frequency` (VGG-19's first block, for the config's `frequency_weights`) or
`lpips_alex`, `lpips_vgg` (for its `lpips`). The files of torchvision and LPIPS v0.1 are
fetched by PyTorch (frequency: 548 MB, alex 233, vgg 528) and checked by SHA-256.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from alignerf.networks import backbones, convnet

# (address, SHA-256). The names hold the first 8 digits of the hashes; the others are
# those that several projects have pinned independently of each other.
TORCHVISION = "https://download.pytorch.org/models"
# Hashes are of the files in this commit.
LPIPS = (
    "https://raw.githubusercontent.com/richzhang/PerceptualSimilarity/"
    "082bb24f84c091ea94de2867d34c4544f68e0963/lpips/weights/v0.1"
)
BACKBONES = {
    "frequency": (
        f"{TORCHVISION}/vgg19-dcbb9e9d.pth",
        "dcbb9e9dad569fff7a846263a77324fc34978fea2bfb039c012d710e1776ae44",
    ),
    "lpips_alex": (
        f"{TORCHVISION}/alexnet-owt-7be5be79.pth",
        "7be5be791159472b1fbf3c69796f7cb30dca7ad8466c2df70058c37116cdee02",
    ),
    "lpips_vgg": (
        f"{TORCHVISION}/vgg16-397923af.pth",
        "397923af8e79cdbb6a7127f12361acd7a2f83e06b05044ddf496e83de57a5bf0",
    ),
}
HEADS = {
    "lpips_alex": (
        f"{LPIPS}/alex.pth",
        "df73285e35b22355a2df87cdb6b70b343713b667eddbda73e1977e0c860835c0",
    ),
    "lpips_vgg": (
        f"{LPIPS}/vgg.pth",
        "a78928a0af1e5f0fcb1f3b9e8f8c3a2a5a3de244d830ad5c1feddc79b8432868",
    ),
}
# Where the layers, in our order, stand among torchvision's `features`.
PLACES = {
    "frequency": (0, 2),
    "lpips_alex": (0, 3, 6, 8, 10),
    "lpips_vgg": (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28),
}
# Of ImageNet's training photos, in [0, 1]: what torchvision's VGG-19 was trained on.
MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)


def main(argv=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    what = f"one of {', '.join(BACKBONES)}"
    parser.add_argument("what", choices=BACKBONES, metavar="WHAT", help=what)
    parser.add_argument("--out", required=True, type=Path, help=".npz, written")
    args = parser.parse_args(argv)
    heads = {}
    if args.what in HEADS:
        heads = heads_of(args.what, fetch(*HEADS[args.what]))
    arrays = layers_of(args.what, fetch(*BACKBONES[args.what]))
    args.out.parent.mkdir(parents=True, exist_ok=True)
    np.savez(args.out, **arrays, **heads)


def fetch(url, sha256):
    """{name: array} of the state dict at an address."""
    import torch

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "weights.pth"
        # Which compares as many digits as it is given: all.
        torch.hub.download_url_to_file(url, str(path), hash_prefix=sha256)
        state = torch.load(path, map_location="cpu", weights_only=True)
    return {name: tensor.detach().numpy() for name, tensor in state.items()}


def layers_of(what, state):
    """{array: kernel (HWIO) or bias} of torchvision's backbone, and what is beside."""
    net = what.removeprefix("lpips_")
    is_lpips = net in backbones.NETS
    layers = backbones.NETS[net].layers if is_lpips else convnet.VGG19
    arrays = {} if is_lpips else {"mean": np.float32(MEAN), "std": np.float32(STD)}
    for name, place in zip(layers, PLACES[what], strict=True):
        # PyTorch's kernels are [out, c, kh, kw].
        kernel = state[f"features.{place}.weight"]
        arrays[f"{name}_w"] = kernel.transpose(2, 3, 1, 0)
        arrays[f"{name}_b"] = state[f"features.{place}.bias"]
    return arrays


def heads_of(what, state):
    """{lin<k>: weights [c] of tap k} of LPIPS' linear heads."""
    channels = backbones.NETS[what.removeprefix("lpips_")].channels
    return {
        f"lin{k}": state[f"lin{k}.model.1.weight"].ravel() for k in range(len(channels))
    }


if __name__ == "__main__":
    main()
