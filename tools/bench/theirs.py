"""The peer's training and rendering as the benchmarks call them.

Settings are those of its `configs/360.gin`; only sizes and lengths are ours. Its own
functions do all the work: batches from its data set, its pmapped step, its rendering.
"""

import dataclasses
import itertools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec


@dataclasses.dataclass(frozen=True)
class Peer:
    """A model of the peer's with its training step and its rendering function.

    `scope` names its gin settings: they are read whenever a function is traced.
    """

    modules: Any
    scope: str
    config: Any
    model: Any
    init: Any  # key -> variables
    _step: Any
    _render: Any

    def step(self, rngs, state, batch, share):
        """One training step: (state, stats, rngs), by its own pmapped function."""
        with self.modules.gin.config_scope(self.scope):
            state, stats, rngs = self._step(rngs, state, batch, CAMERAS, share, 1.0)
        return state, stats, rngs

    def rngs(self, seed):
        """Random keys of the devices."""
        keys = jax.random.split(jax.random.PRNGKey(seed), jax.local_device_count())
        return shard(keys)

    def render(self, variables, rays):
        """Colours [n, 3] of rays [n], chunk by chunk, by its own function."""
        with self.modules.gin.config_scope(self.scope):
            found = self.modules.models.render_image(
                lambda rng, chunk: self._render(variables, 1.0, rng, chunk),
                jax.tree.map(lambda x: x[None], rays),
                None,
                self.config,
                verbose=False,
            )
        return found["rgb"][0]


# Rays are cast on the host under 360.gin, so that the step sees no cameras.
CAMERAS = (None, None, None, None)


def make(
    modules,
    *,
    name,
    near,
    far,
    samples,
    proposal,
    field,
    batch_rays,
    steps,
    gather=False,
    chunk_rays=4096,
    training=None,
) -> Peer:
    """The peer's model, optimizer and step of our terms.

    `samples` [proposal, proposal, ..., field] has equal proposal rounds; `proposal`
    and `field` are our config's mappings of kind mlp; `gather` is its
    use_gpu_resampling; `training` more of its Config's keys.
    """
    bind(modules, name, samples=samples, proposal=proposal, field=field, gather=gather)
    with modules.gin.config_scope(name):
        config = modules.configs.Config(
            near=near,
            far=far,
            batch_size=batch_rays,
            render_chunk_size=chunk_rays,
            max_steps=steps,
            **(training or {}),
        )
        model = modules.models.Model(config=config)

    def init(key):
        with modules.gin.config_scope(name):
            rays = modules.utils.dummy_rays(include_exposure_values=True)
            _, variables = modules.models.construct_model(key, rays, config)
        return variables

    return Peer(
        modules=modules,
        scope=name,
        config=config,
        model=model,
        init=init,
        _step=modules.train_utils.create_train_step(model, config),
        _render=modules.train_utils.create_render_fn(model),
    )


def bind(modules, name, *, samples, proposal, field, gather):
    """Read its 360.gin, and set what is ours in the scope `name`."""
    if len(set(samples[:-1])) > 1:
        raise ValueError(f"samples {samples}: the peer has equal proposal rounds")
    values = {
        "Model.num_prop_samples": samples[0],
        "Model.num_nerf_samples": samples[-1],
        "Model.num_levels": len(samples),
        "Model.use_gpu_resampling": gather,
        "PropMLP.net_depth": proposal["depth"],
        "PropMLP.net_width": proposal["width"],
        "NerfMLP.net_depth": field["depth"],
        "NerfMLP.net_width": field["width"],
        "NerfMLP.bottleneck_width": field.get("bottleneck", 256),
        "NerfMLP.net_width_viewdirs": field.get("view_width", 128),
        "PropMLP.max_deg_point": proposal.get("degrees", 12),
        "NerfMLP.max_deg_point": field.get("degrees", 12),
    }
    with modules.gin.unlock_config():
        modules.gin.parse_config_file(str(modules.path / "configs" / "360.gin"))
        for key, value in values.items():
            modules.gin.bind_parameter(f"{name}/{key}", value)


def shard(tree):
    """Arrays whose first axis is that of the devices, placed as its pmap leaves them.

    Placed otherwise, its second step would be compiled anew.
    """
    mesh = Mesh(np.array(jax.local_devices()), ("batch",))
    return jax.device_put(tree, NamedSharding(mesh, PartitionSpec("batch")))


def make_dataset(peer: Peer, photos, *, split="train"):
    """The peer's own dataset over photos (`cases.Photos`) that are in memory.

    `next` of a training set gives a batch of random rays, cast with numpy on the
    host; of a test set a view's rays and colours.
    """

    class Memory(peer.modules.datasets.Dataset):
        def _load_renderings(self, config):
            self.images = photos.images / np.float32(255)
            self.height, self.width = photos.images.shape[1:3]
            self.pixtocams = photos.pixtocams.astype(np.float32)
            self.camtoworlds = photos.camtoworlds.astype(np.float32)

    return Memory(split, "", peer.config)


class Training:
    """The peer's training as a call without arguments, over batches made before."""

    def __init__(self, peer: Peer, photos, *, batches=8, seed=0):
        self.peer, self._seed = peer, seed
        self._data = make_dataset(peer, photos)
        self._batches = itertools.cycle([self.batch() for _ in range(batches)])
        variables = peer.init(jax.random.PRNGKey(seed))
        state, _ = peer.modules.train_utils.create_optimizer(peer.config, variables)
        self._place(state)

    def _place(self, state):
        """On every device, as its train.py does."""
        count = jax.local_device_count()
        self._state = shard(jax.tree.map(lambda x: jnp.stack([x] * count), state))
        self._rngs = self.peer.rngs(self._seed)

    def restart(self):
        """Fresh parameters and optimizer; what was compiled stays."""
        variables = self.peer.init(jax.random.PRNGKey(self._seed))
        # With the same optimizer object: another would be compiled anew.
        adam = self._state.tx.init(variables)
        self._place(self._state.replace(step=0, params=variables, opt_state=adam))

    def batch(self):
        """A fresh batch on the device."""
        return shard(next(self._data))

    def __call__(self, batch=None, share=0.5):
        batch = next(self._batches) if batch is None else batch
        self._state, stats, self._rngs = self.peer.step(
            self._rngs, self._state, batch, share
        )
        return self._state, stats

    @property
    def parameters(self) -> int:
        """How many there are."""
        return sum(leaf.size for leaf in jax.tree.leaves(self.variables()))

    def variables(self):
        """What rendering wants: the first device's parameters."""
        return jax.tree.map(lambda x: x[0], self._state.params)

    def view(self, index):
        """All rays [h w] of a view, cast by the peer."""
        rays = self._data.generate_ray_batch(index).rays
        return jax.tree.map(lambda x: x.reshape(-1, x.shape[-1]), rays)
