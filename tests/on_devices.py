"""Several steps on one device and on all: run by test_gradients with eight of them."""

import json
import re

import jax
import numpy as np

from alignerf.processes import devices
from alignerf.training import gradients, renderer
from tests import training_cases as cases

METHODS = {"mipnerf360": cases.baseline(), "alignerf": cases.alignerf(patches=16)}
STEPS = 4


def losses(method, views, *, micro_batches, used):
    """The losses of a few steps, and the collectives of the compiled step."""
    mesh = gradients.make_mesh(method.units, used)
    state, step = cases.start(method, micro_batches=micro_batches, mesh=mesh)
    state, views = devices.place((state, views), mesh)
    compiled = step.func.compiled(state, views, **step.keywords)
    collectives = re.findall(
        r" (all-\w+|collective-\w+|reduce-scatter)\(",
        "".join(part.as_text() for part in compiled),
    )
    found = []
    for _ in range(STEPS):
        state, stats = compiled(state, views, **step.keywords)
        found.append(float(stats["loss"]))
    copies = [np.asarray(x.data) for x in jax.tree.leaves(state)[-1].addressable_shards]
    assert all(np.array_equal(copies[0], copy) for copy in copies)
    return found, sorted(set(collectives)), len(copies)


def images(method, views, used, accelerated=False):
    """A view by some devices, as if they were accelerators: [h, w, 3], for JSON."""
    renderer.on_accelerator = lambda: accelerated
    params = cases.varied(jax.jit(method.init)(jax.random.key(0)), 0.1)
    render = renderer.Renderer(method, 23, 18, used)
    camera = views.pixtocams[0], views.camtoworlds[0]
    return render(params, *camera)[0].tolist()


def main():
    views, every = cases.make_views(), jax.local_devices()
    found = {
        name: {
            "one": losses(method, views, micro_batches=1, used=every[:1]),
            "all": losses(method, views, micro_batches=2, used=every),
            "images": [
                images(method, views, *used)
                for used in ((every[:1],), (every,), (every, True))
            ],
        }
        for name, method in METHODS.items()
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main()
