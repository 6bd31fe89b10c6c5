"""Weights of the fixed networks as .npz.

    python -m alignerf.networks.weights WHAT --out FILE

WHAT is `frequency` (VGG-19's first block, for the config's `frequency_weights`) or
`lpips_alex`, `lpips_squeeze`, `lpips_vgg` (for its `lpips`). They are made from the
files that torchvision and LPIPS v0.1 publish: given as --backbone and --heads, or
fetched once by HTTPS (frequency: 548 MB, alex 233, squeeze 5, vgg 528) into a
scratch folder beside the output, which is gone afterwards.

A file's SHA-256 must be that of the published one.
"""

import argparse
import pathlib

import numpy as np

from alignerf.io import atomic, downloads, faults
from alignerf.io.downloads import Published
from alignerf.networks import backbones, convnet, torch_files

# The names hold the first 8 digits of the hashes; the others are those that several
# projects have pinned independently of each other.
TORCHVISION = "https://download.pytorch.org/models"
# Sizes and hashes are of the files in this commit.
LPIPS = (
    "https://raw.githubusercontent.com/richzhang/PerceptualSimilarity/"
    "082bb24f84c091ea94de2867d34c4544f68e0963/lpips/weights/v0.1"
)
BACKBONES = {
    "frequency": Published(
        f"{TORCHVISION}/vgg19-dcbb9e9d.pth",
        574_673_361,
        "dcbb9e9dad569fff7a846263a77324fc34978fea2bfb039c012d710e1776ae44",
    ),
    "lpips_alex": Published(
        f"{TORCHVISION}/alexnet-owt-7be5be79.pth",
        244_408_911,
        "7be5be791159472b1fbf3c69796f7cb30dca7ad8466c2df70058c37116cdee02",
    ),
    "lpips_squeeze": Published(
        f"{TORCHVISION}/squeezenet1_1-b8a52dc0.pth",
        4_958_839,
        "b8a52dc049b60e4b6ab68ad0df457362afab8b6304b2febdc1650a5dab4d7e7b",
    ),
    "lpips_vgg": Published(
        f"{TORCHVISION}/vgg16-397923af.pth",
        553_433_881,
        "397923af8e79cdbb6a7127f12361acd7a2f83e06b05044ddf496e83de57a5bf0",
    ),
}
HEADS = {
    "lpips_alex": Published(
        f"{LPIPS}/alex.pth",
        6_009,
        "df73285e35b22355a2df87cdb6b70b343713b667eddbda73e1977e0c860835c0",
    ),
    "lpips_squeeze": Published(
        f"{LPIPS}/squeeze.pth",
        10_811,
        "4a5350f23600cb79923ce65bb07cbf57dca461329894153e05a1346bd531cf76",
    ),
    "lpips_vgg": Published(
        f"{LPIPS}/vgg.pth",
        7_289,
        "a78928a0af1e5f0fcb1f3b9e8f8c3a2a5a3de244d830ad5c1feddc79b8432868",
    ),
}
# Where the layers, in our order, stand among torchvision's `features`.
PLACES = {
    "frequency": (0, 2),
    "lpips_alex": (0, 3, 6, 8, 10),
    "lpips_squeeze": (
        "0",
        *(
            f"{place}.{part}"
            for place in (3, 4, 6, 7, 9, 10, 11, 12)
            for part in ("squeeze", "expand1x1", "expand3x3")
        ),
    ),
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
    parser.add_argument("--out", required=True, help=".npz, written")
    parser.add_argument("--backbone", help="torchvision's .pth, else fetched")
    parser.add_argument("--heads", help="LPIPS' linear heads .pth, else fetched")
    args = parser.parse_args(argv)
    if args.heads and args.what not in HEADS:
        raise ValueError(f"--heads: {args.what} has none")
    out = pathlib.Path(args.out)
    if out.suffix != ".npz":
        raise ValueError(f"--out: {out} does not end in .npz")
    with atomic.scratch_folder(out.parent) as scratch:
        # The small file first: what is wrong with it shows before a long download.
        if args.what in HEADS:
            rest = heads_of(args.what, find(args.heads, HEADS[args.what], scratch))
        else:
            rest = {"mean": np.float32(MEAN), "std": np.float32(STD)}
        backbone = find(args.backbone, BACKBONES[args.what], scratch)
        with atomic.replace_file(out) as path:
            np.savez(path, **layers_of(args.what, backbone), **rest)


def layers_of(what, path):
    """{array: kernel (HWIO) or bias} of torchvision's backbone in a .pth."""
    net = what.removeprefix("lpips_")
    layers = backbones.NETS[net].layers if net in backbones.NETS else convnet.VGG19
    places = {
        name: f"features.{place}"
        for name, place in zip(layers, PLACES[what], strict=True)
    }
    shapes = {}
    for name, (side, c, out) in layers.items():
        shapes[f"{places[name]}.weight"] = (out, c, side, side)
        shapes[f"{places[name]}.bias"] = (out,)
    tensors = torch_files.read(path, shapes)
    arrays = {}
    for name, place in places.items():
        # PyTorch's kernels are [out, c, kh, kw].
        arrays[f"{name}_w"] = tensors[f"{place}.weight"].transpose(2, 3, 1, 0)
        arrays[f"{name}_b"] = tensors[f"{place}.bias"]
    return arrays


def heads_of(what, path):
    """{lin<k>: weights [c] of tap k} of LPIPS' linear heads in a .pth."""
    channels = backbones.NETS[what.removeprefix("lpips_")].channels
    shapes = {f"lin{k}.model.1.weight": (1, c, 1, 1) for k, c in enumerate(channels)}
    tensors = torch_files.read(path, shapes)
    return {name.split(".")[0]: array.ravel() for name, array in tensors.items()}


def find(path, published, folder):
    """Path of a published file, its hash checked: `path`, or a download."""
    if path is None:
        try:
            path = downloads.fetch(published, folder)
        except ValueError as error:
            raise ValueError(
                f"{error}: fetch it by other means and give its path"
            ) from None
    downloads.check(path, published)
    return path


if __name__ == "__main__":
    faults.run(main)
