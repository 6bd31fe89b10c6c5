"""Train with nerfstudio and render all views of its data, by the python that has it.

    PYTHON run_nerfstudio.py train --cores 2 -- nerfacto --data DATA --output-dir MODEL
    PYTHON run_nerfstudio.py render --cores 2 MODEL RENDERS DEPTH

`train` is ns-train with its words after `--`; @FILE stands for the lines of a file, a
word each. `render` writes RENDERS/<view>.png of
each training and test view, and DEPTH/<view>.npy [height, width] float32: depth along
the optical axis in the units of the poses of transforms.json, 0 where nothing is.
Views have the names of their photos, and the size and lens of them. Cameras are those
given: what nerfstudio's own camera optimizer has learned moves no render.

Both leave LPIPS out, whose weights nerfstudio fetches from the network at its start.
MODEL must be your own: nerfstudio's config.yml is code. Checked with nerfstudio 1.1.5.
This file imports nothing of alignerf.
"""

import argparse
import json
import random
import sys
from pathlib import Path

import numpy as np
from PIL import Image

# That are rendered at once: more are no faster on a CPU, and take memory.
RAYS = 1024
# Where less of the light comes from the scene, there is nothing.
MIN_ACCUMULATION = 0.5


def train(words):
    """nerfstudio's own training, with the words of its command line."""
    from nerfstudio.scripts import train as ns_train

    sys.argv = ["ns-train", *words]
    ns_train.entrypoint()


def seed_of(words):
    """The seed that ns-train's words say, else its own."""
    seed = argparse.ArgumentParser(allow_abbrev=False)
    seed.add_argument("--machine.seed", type=int, default=42, dest="seed")
    return seed.parse_known_args(words)[0].seed


def render(model, renders, depth):
    """Render the training and the test views of a model; arguments: folders.

    Raises ValueError where the model is not one, or its renders would leave out a lens.
    """
    config_path = only_config(model)
    allow_numbers()
    from nerfstudio.utils import eval_utils

    config, pipeline, _, step = eval_utils.eval_setup(
        config_path, eval_num_rays_per_chunk=RAYS, test_mode="inference"
    )
    print(f"{config.method_name} after {step} steps", flush=True)
    of_gaussians = config.method_name.startswith("splatfacto")
    # Anew: that of the pipeline has not looked at how large the photos are.
    dataparser = config.pipeline.datamanager.dataparser
    dataparser.data = config.pipeline.datamanager.data or dataparser.data
    parser = dataparser.setup()
    for folder in (renders, depth):
        folder.mkdir(parents=True, exist_ok=True)
    for split in ("train", "test"):
        data = parser.get_dataparser_outputs(split=split)
        if of_gaussians:
            check_no_lens(config.method_name, data.cameras.distortion_params)
        units = applied_scale(dataparser.data) / data.dataparser_scale
        cameras = data.cameras.to(pipeline.device)
        for i, photo in enumerate(data.image_filenames):
            camera = cameras[i : i + 1]
            rgb, z = of_camera(pipeline.model, camera, of_gaussians=of_gaussians)
            write_view(photo.stem, rgb, z * units, renders, depth)
        print(f"{len(data.image_filenames)} views of {split}", flush=True)


def allow_numbers():
    """Let torch read the numbers of numpy that are in nerfstudio's checkpoints.

    From 2.6 on it reads no others than its own, so as to run no code of a file.
    """
    import torch

    number = np.float64(0)
    known = [number.__reduce__()[0], np.dtype, type(number.dtype)]
    if hasattr(torch.serialization, "add_safe_globals"):
        torch.serialization.add_safe_globals(known)


def leave_out_lpips():
    """Put something in the place of LPIPS that says nothing of any images."""
    import torch
    import torchmetrics.image.lpip

    class NoLpips(torch.nn.Module):
        def __init__(self, *_args, **_kwargs):
            super().__init__()

        def forward(self, *_images):
            return torch.tensor(float("nan"))

    torchmetrics.image.lpip.LearnedPerceptualImagePatchSimilarity = NoLpips


def only_config(model):
    """The config.yml of the one training that lies below a folder."""
    found = sorted(model.rglob("config.yml"))
    if len(found) != 1:
        raise ValueError(f"{model}: {len(found)} trainings (config.yml) instead of one")
    return found[0]


def check_no_lens(method, distortion):
    """Raise ValueError for photos with a lens, which the renders would leave out."""
    if distortion is not None and distortion.any():
        raise ValueError(f"{method} renders no lens distortion: undistort the photos")


def of_camera(model, camera, *, of_gaussians):
    """(rgb [h, w, 3], depth along the optical axis [h, w]) in the model's units.

    camera: nerfstudio's Cameras, of one. of_gaussians: whether its depth is along the
    axis already, and not along the ray.
    """
    import torch

    with torch.no_grad():
        outputs = model.get_outputs_for_camera(camera)
    rgb, shown, z = (
        outputs[name].cpu().numpy() for name in ("rgb", "accumulation", "depth")
    )
    z = z[..., 0]
    if not of_gaussians:
        # Where half of the light comes from nearer: the mean is drawn far by haze.
        rays = camera.generate_rays(camera_indices=0, keep_shape=True)
        directions = rays.directions.cpu().numpy()
        z = along_axis(z, directions, camera.camera_to_worlds[0].cpu().numpy())
    return rgb, np.where(shown[..., 0] > MIN_ACCUMULATION, z, 0)


def along_axis(distance, directions, camtoworld):
    """Depth along the optical axis [h, w] of a distance along the ray [h, w].

    directions [h, w, 3]: of length 1, in the world. camtoworld [3, 4]: OpenGL axes.
    """
    return distance * -(directions @ camtoworld[:, 2])


def applied_scale(data):
    """By what transforms.json says that its poses were scaled: nerfstudio undoes it."""
    path = data if data.suffix == ".json" else data / "transforms.json"
    if not path.is_file():
        return 1.0
    return float(json.loads(path.read_text(encoding="utf-8")).get("applied_scale", 1))


def write_view(name, rgb, z, renders, depth):
    """Write RENDERS/<name>.png and DEPTH/<name>.npy; ValueError where one is there."""
    path = renders / f"{name}.png"
    if path.exists():
        raise ValueError(f"{path} is there already: of another photo of this name?")
    np.save(depth / f"{name}.npy", z.astype(np.float32))
    Image.fromarray(np.round(255 * rgb.clip(0, 1)).astype(np.uint8)).save(path)


def main(argv=None):
    args = parse(argv)
    import torch

    torch.set_num_threads(args.cores)
    leave_out_lpips()
    if args.what == "train":
        train(args.words[1:] if args.words[:1] == ["--"] else args.words)
    else:
        render(args.model, args.renders, args.depth)


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__.partition("\n")[0], fromfile_prefix_chars="@"
    )
    kinds = parser.add_subparsers(dest="what", required=True)
    training = kinds.add_parser("train", help="ns-train, with its words after --")
    training.add_argument("--cores", type=int, default=1)
    training.add_argument("words", nargs=argparse.REMAINDER)
    rendering = kinds.add_parser("render", help="all views of a model's data")
    rendering.add_argument("--cores", type=int, default=1)
    for folder in ("model", "renders", "depth"):
        rendering.add_argument(folder, type=Path)
    return parser.parse_args(argv)


def sow(seed):
    """Give this process a seed, from which it draws pixels of photos and masks."""
    import torch

    random.seed(seed)
    torch.manual_seed(seed)


# The process that nerfstudio starts to draw rays: it has no seed of its own, and no two
# trainings would be alike.
if __name__ == "__mp_main__":
    sow(seed_of(sys.argv))

if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"error: {error}")
