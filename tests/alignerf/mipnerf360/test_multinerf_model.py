"""The released model beside ours, with its parameters in ours.

ALIGNERF_MULTINERF names a checkout of google-research/multinerf, which needs
gin-config beside our environment; without it all of this is skipped. Of its functions
one by one, the float64 twins of the other tests say as much. The same directions come
in another order and with other signs: parameters and gradients are taken from one order
to the other.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf import fields
from alignerf.fields import mlp
from alignerf.mipnerf360 import losses
from alignerf.mipnerf360 import model as mipnerf360
from alignerf.scenes import cameras
from tests import twins
from tools.bench import theirs

pytestmark = pytest.mark.filterwarnings("ignore")
RAYS = 300
NEAR, FAR, SAMPLES = 0.2, 1e6, (64, 64, 32)


def peers_basis(peer):
    """Its 21 directions as ours: (index of ours, sign) of each of its own."""
    theirs = peer.geopoly.generate_basis("icosahedron", 2)
    cosines = theirs @ mlp.icosahedral_basis()
    index = np.abs(cosines).argmax(axis=1)
    assert sorted(index) == list(range(21))
    return index, np.sign(cosines[range(21), index])


def test_encoding(peer, rng):
    (mean,) = twins.f32(rng.uniform(-2, 2, (1000, 3)))
    a = rng.normal(size=(1000, 3, 3)) * 10 ** rng.uniform(-4, 0, (1000, 1, 1))
    (root,) = twins.f32(a)
    cov = jnp.swapaxes(root, -1, -2) @ root
    basis = jnp.asarray(peer.geopoly.generate_basis("icosahedron", 2), jnp.float32).T
    lifted = peer.coord.lift_and_diagonalize(mean, cov, basis)
    theirs = np.asarray(peer.coord.integrated_pos_enc(*lifted, 0, 12))
    ours = mlp.integrated_encoding(*mlp.project(mean, root), 12)
    index, sign = peers_basis(peer)
    sine, cosine = (np.asarray(x).reshape(12, 21, 1000)[:, index] for x in ours)
    ours = np.stack([sine * sign[:, None], cosine]).reshape(504, 1000).T
    # An angle of 2^11 2 has steps of 5e-4 in float32, and theirs adds a quarter turn.
    tolerance = np.repeat(np.tile(2.0 ** np.arange(12), 2), 21) * 1e-6
    twins.assert_close(ours, np.float64(theirs), atol=tolerance + 1e-6)
    assert np.abs(ours - theirs)[:, tolerance < 1e-5].max() < 1e-5


def in_our_order(layer, order, degrees):
    """A layer of theirs as ours: outputs first, the encoding's inputs rearranged."""
    kernel = np.asarray(layer["kernel"]).T.copy()
    index, sign = order
    size = 2 * degrees * 21
    if kernel.shape[1] >= size:
        # The encoding is all of the input, or its end.
        block = kernel[:, -size:].reshape(-1, 2, degrees, 21)
        moved = np.empty_like(block)
        moved[..., index] = block * np.stack([sign, np.ones(21)])[:, None]
        kernel[:, -size:] = moved.reshape(-1, size)
    return {"kernel": kernel, "bias": np.asarray(layer["bias"])}


def as_ours(tree, order, degrees):
    """Our parameters, or gradients, from theirs."""
    found = {}
    for ours, name, depth in (("proposal", "PropMLP_0", 4), ("field", "NerfMLP_0", 8)):
        layers = [
            in_our_order(tree["params"][name][f"Dense_{i}"], order, degrees)
            for i in range(len(tree["params"][name]))
        ]
        found[ours] = {f"Dense_{i}": layer for i, layer in enumerate(layers[:depth])}
        found[ours]["density"] = layers[depth]
        if ours == "field":
            found[ours]["bottleneck"] = layers[depth + 1]
            found[ours]["head"] = {"Dense_0": layers[depth + 2], "values": layers[-1]}
    return found


@pytest.fixture(scope="module", params=[4, 12])
def pair(request, peer):
    """(degrees, theirs, its variables, ours, the order of directions)."""
    degrees = request.param
    trunk = {"depth": 8, "width": 48, "degrees": degrees}
    options = {
        "proposal": {"depth": 4, "width": 32, "degrees": degrees},
        "field": trunk | {"bottleneck": 24, "view_width": 16},
    }
    scale = {"near": NEAR, "far": FAR, "samples": SAMPLES}
    other = theirs.make(
        peer, name=f"d{degrees}", batch_rays=RAYS, steps=10, **options, **scale
    )
    variables = other.init(jax.random.PRNGKey(3))
    rng = np.random.default_rng(5)
    # Biases too, which start at zero, and densities that differ.
    variables = jax.tree.map(
        lambda x: (
            x + 0.3 * jnp.asarray(rng.normal(size=x.shape), x.dtype)
            if x.ndim == 1
            else 1.3 * x
        ),
        variables,
    )
    ours = mipnerf360.Model(
        **{name: fields.make("mlp", **mapping) for name, mapping in options.items()},
        **scale,
    )
    return degrees, other, variables, ours, peers_basis(peer)


def make_rays(peer, rng):
    """The same rays for both."""
    viewdirs = rng.normal(size=(RAYS, 3))
    viewdirs /= np.linalg.norm(viewdirs, axis=-1, keepdims=True)
    directions = viewdirs * rng.uniform(1, 1.5, (RAYS, 1))
    origins, radii = rng.normal(size=(RAYS, 3)) / 3, np.full((RAYS, 1), 2e-3)
    ours = cameras.Rays(*twins.f32(origins, directions, viewdirs, radii))
    ones = jnp.ones((RAYS, 1))
    other = peer.utils.Rays(
        **ours._asdict(),
        imageplane=jnp.zeros((RAYS, 2)),
        lossmult=ones,
        near=NEAR * ones,
        far=FAR * ones,
        cam_idx=jnp.zeros((RAYS, 1), jnp.int32),
    )
    return ours, other


def their_losses(other, variables, rays, photo, share):
    """Terms without their weights, and what the model returned."""
    train = other.modules.train_utils
    renderings, history = other.model.apply(
        variables, None, rays, train_frac=share, compute_extras=False
    )
    batch = other.modules.utils.Batch(rays=rays, rgb=photo)
    data, _ = train.compute_data_loss(batch, renderings, rays, 1.0, other.config)
    terms = {
        "data": data,
        # It means over the samples, where Eq. 13 is a sum.
        "interlevel": train.interlevel_loss(history, other.config),
        "distortion": train.distortion_loss(history, other.config),
    }
    return terms, (renderings[-1]["rgb"], history)


def our_losses(model, params, rays, photo, share):
    found = model.apply({"params": params}, rays, train_fraction=share)
    terms = {
        "data": losses.charbonnier(found.values, photo, jnp.ones(RAYS)),
        "interlevel": losses.interlevel(found.histograms),
        "distortion": 0.01 * losses.distortion(found.histograms),
    }
    return terms, found


def with_gradient(function):
    """(loss, (terms, what was returned)), gradient."""

    def total(params):
        terms, more = function(params)
        return sum(terms.values()), (terms, more)

    return jax.jit(jax.value_and_grad(total, has_aux=True))


@pytest.mark.parametrize("share", [0.05, 1.0])
def test_model(pair, peer, rng, share):
    """Samples, weights, colours, losses and gradients of two proposal rounds.

    At degree 4 all is arithmetic in float32. At degree 12 an angle has steps of 5e-4
    in either code, which the layers pass on; in a gradient a ReLU near zero then
    falls to one side or the other.
    """
    degrees, other, variables, model, order = pair
    loose = {4: 1.0, 12: 30.0}[degrees]
    rays, their_rays = make_rays(peer, rng)
    (photo,) = twins.f32(rng.uniform(size=(RAYS, 3)))
    with peer.gin.config_scope(other.scope):
        (_, (their_terms, (rgb, history))), their_grads = with_gradient(
            lambda v: their_losses(other, v, their_rays, photo, share)
        )(variables)
    params = jax.tree.map(jnp.asarray, as_ours(variables, order, degrees))
    (_, (terms, found)), grads = with_gradient(
        lambda p: our_losses(model, p, rays, photo, share)
    )(params)
    twins.assert_close(found.values, np.float64(rgb), atol=3e-6 * loose)
    for (sdist, weights), level in zip(found.histograms, history, strict=True):
        twins.assert_close(sdist, np.float64(level["sdist"]), atol=1e-5 * loose)
        wanted = np.float64(level["weights"])
        twins.assert_close(weights, wanted, rtol=0, atol=3e-6 * loose)
    for name, value in their_terms.items():
        np.testing.assert_allclose(terms[name], value, rtol=3e-6 * loose)
    theirs_as_ours = as_ours(their_grads, order, degrees)
    assert jax.tree.structure(theirs_as_ours) == jax.tree.structure(grads)
    for wanted, grad in zip(
        jax.tree.leaves(theirs_as_ours), jax.tree.leaves(grads), strict=True
    ):
        assert np.linalg.norm(wanted - grad) <= 5e-4 * loose * np.linalg.norm(wanted)
