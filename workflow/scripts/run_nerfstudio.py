"""Train with nerfstudio and render all views of its data, by the python that has it.

    PYTHON run_nerfstudio.py train --cores 2 -- nerfacto --data DATA --output-dir MODEL ...
    PYTHON run_nerfstudio.py render --cores 2 MODEL RENDERS DEPTH

`train` is ns-train with its words after `--`. `render` writes RENDERS/<view>.png of
each training and test view, and DEPTH/<view>.npy [height, width] float32: depth along
the optical axis in the units of the poses of transforms.json, 0 where nothing is.
Views have the names of their photos, and the size and lens of them. Cameras are those
given: what nerfstudio's own camera optimiser has learnt moves no render.

Both leave LPIPS out, whose weights nerfstudio fetches from the network before it trains.
MODEL must be your own: nerfstudio's config.yml is code. Checked with nerfstudio 1.1.5.
This file imports nothing of alignerf.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
import torch
import torchmetrics.image.lpip
from PIL import Image

# Of rays that are rendered at once; 2**15, as nerfstudio has it, takes 2 GB.
RAYS = 2**13


class NoLpips(torch.nn.Module):
    """In the place of LPIPS: says nothing of any images."""

    def __init__(self, *_args, **_kwargs):
        super().__init__()

    def forward(self, *_images):
        return torch.tensor(float("nan"))


def allow_numbers():
    """Let torch read the numbers of numpy that are in nerfstudio's checkpoints.

    From 2.6 on it reads no others than its own, so as to run no code of a file.
    """
    number = np.float64(0)
    known = [number.__reduce__()[0], np.dtype, type(number.dtype)]
    if hasattr(torch.serialization, "add_safe_globals"):
        torch.serialization.add_safe_globals(known)


def train(words):
    """nerfstudio's own training, with the words of its command line."""
    from nerfstudio.scripts import train as ns_train

    sys.argv = ["ns-train", *words]
    ns_train.entrypoint()


@torch.no_grad()
def render(model, renders, depth):
    """Render the training and the test views of a model; arguments: folders.

    Raises ValueError where the model is not one, or its renders would leave out a lens.
    """
    from nerfstudio.utils import eval_utils

    allow_numbers()
    config_path = only_config(model)
    config, pipeline, _, step = eval_utils.eval_setup(
        config_path, eval_num_rays_per_chunk=RAYS, test_mode="inference"
    )
    print(f"{config.method_name} after {step} steps", flush=True)
    # Anew: that of the pipeline has not looked at how large the photos are.
    dataparser = config.pipeline.datamanager.dataparser
    dataparser.data = config.pipeline.datamanager.data or dataparser.data
    parser = dataparser.setup()
    for folder in (renders, depth):
        folder.mkdir(parents=True, exist_ok=True)
    for split in ("train", "test"):
        data = parser.get_dataparser_outputs(split=split)
        check(config.method_name, data, renders)
        units = applied_scale(dataparser.data) / data.dataparser_scale
        cameras = data.cameras.to(pipeline.device)
        for i, photo in enumerate(data.image_filenames):
            if (renders / f"{photo.stem}.png").exists():
                raise ValueError(f"{renders}: {photo.stem}.png is there already")
            rgb, z = of_camera(pipeline.model, cameras[i : i + 1])
            np.save(depth / f"{photo.stem}.npy", (z * units).astype(np.float32))
            Image.fromarray(np.round(255 * rgb).astype(np.uint8)).save(
                renders / f"{photo.stem}.png"
            )
        print(f"{len(data.image_filenames)} views of {split}", flush=True)


def only_config(model):
    """The config.yml of the one training that lies below a folder."""
    found = sorted(model.rglob("config.yml"))
    if len(found) != 1:
        raise ValueError(f"{model}: {len(found)} trainings (config.yml) instead of one")
    return found[0]


def is_splat(method):
    """Whether a method is one of Gaussians: its depth is along the optical axis."""
    return method.startswith("splatfacto")


def check(method, data, where):
    """Raise ValueError where a render would not have its photo's lens, or two views
    have one name."""
    names = [photo.stem for photo in data.image_filenames]
    if len(set(names)) < len(names):
        raise ValueError(f"{where}: several photos have one name, but for suffixes")
    distortion = data.cameras.distortion_params
    if is_splat(method) and distortion is not None and distortion.any():
        raise ValueError(f"{where}: {method} renders no lens distortion: undistort first")


def of_camera(model, camera):
    """(rgb [height, width, 3] in [0, 1], depth along the optical axis in the model's
    units [height, width]) as arrays. camera: Cameras of one."""
    outputs = model.get_outputs_for_camera(camera)
    rgb = outputs["rgb"].clamp(0, 1).cpu().numpy()
    shown = outputs["accumulation"][..., 0] > 0.5
    if "expected_depth" in outputs:
        rays = camera.generate_rays(camera_indices=0, keep_shape=True)
        along = -(rays.directions @ camera.camera_to_worlds[0, :3, 2])
        z = outputs["expected_depth"][..., 0].to(along.device) * along
    else:
        z = outputs["depth"][..., 0]
    return rgb, torch.where(shown.to(z.device), z, torch.zeros_like(z)).cpu().numpy()


def applied_scale(data):
    """By what transforms.json says that its poses were scaled: nerfstudio undoes it."""
    path = data if data.suffix == ".json" else data / "transforms.json"
    if not path.is_file():
        return 1.0
    return float(json.loads(path.read_text(encoding="utf-8")).get("applied_scale", 1))


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    kinds = parser.add_subparsers(dest="what", required=True)
    training = kinds.add_parser("train", help="ns-train, with its words after --")
    training.add_argument("--cores", type=int, default=1)
    training.add_argument("words", nargs=argparse.REMAINDER)
    rendering = kinds.add_parser("render", help="all views of a model's data")
    rendering.add_argument("--cores", type=int, default=1)
    for folder in ("model", "renders", "depth"):
        rendering.add_argument(folder, type=Path)
    args = parser.parse_args()
    torch.set_num_threads(args.cores)
    torchmetrics.image.lpip.LearnedPerceptualImagePatchSimilarity = NoLpips
    if args.what == "train":
        train(args.words[1:] if args.words[:1] == ["--"] else args.words)
    else:
        try:
            render(args.model, args.renders, args.depth)
        except (OSError, ValueError) as error:
            sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
