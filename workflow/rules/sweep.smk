# Functions only: the variants of the tradeoff, their jobs and their rows.
def sweep():
    """The config's tradeoff: its scene, and its variants from the base on."""
    if "tradeoff" not in config:
        stop("config: tradeoff: not there, see workflow/config/demo.yaml")
    found = config["tradeoff"]
    return found["scene"], {"base": {}} | found["variants"]


def variant_slice(name):
    """What the training of a variant, and a rendering of it, depend on."""
    job = variant_of(config, name)
    del job["downscale"]
    return as_json(job | {"stage": "full", "alignerf": None})


def photos_of_variant(w):
    """The scene's own photos and cameras, or those made smaller."""
    folder, factor = f"results/{w.scene}", variant_of(config, w.variant)["downscale"]
    if factor != 1:
        folder = f"{folder}/tradeoff/downscale-{factor}"
    return {"photos": f"{folder}/images", "cameras": f"{folder}/cameras.npz"}


def sweep_rows():
    """One entry per variant, with the files that its row comes from."""
    scene, variants = sweep()
    folders = {name: f"results/{scene}/tradeoff/{name}" for name in variants}
    return [
        {
            "variant": name,
            "changes": variants[name],
            "metrics": f"{folder}/metrics.csv",
            "training": f"{folder}/timing.json",
            "rendering": f"{folder}/render_test.json",
        }
        for name, folder in folders.items()
    ]


def sweep_inputs(w):
    keys = ("metrics", "training", "rendering")
    return [row[key] for row in sweep_rows() for key in keys]
