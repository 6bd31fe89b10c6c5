"""Instant-NGP (arXiv 2201.05989): a hash grid in a box, learnt within minutes.

The grid's rows and two small networks say what a point is like. Its own sampler marches
through a grid of what is occupied; here proposals find the samples, as in mip-NeRF 360
(docs/evidence/systems.md says why). The loss is Huber's.
"""

from alignerf.fields import box
from alignerf.mipnerf360 import model as mipnerf360
from alignerf.systems import rendering


def make(chosen, *, moving=False, native=False):
    """The system of `keys.model.InstantNgp`, and its loss.

    moving: its renders can be differentiated in their rays. native: whether the
    kernels are there.
    """
    shared = {"side": chosen.side, "coarsest": chosen.coarsest}
    shared |= {"moving": moving, "native": native}
    field = box.Box(
        levels=chosen.levels,
        log2_entries=chosen.log2_entries,
        features=chosen.features,
        finest=chosen.finest,
        width=chosen.width,
        precision=chosen.precision,
        **shared,
    )
    # A half of the levels, a quarter of the rows: enough to say where to look.
    proposal = box.Box(
        levels=max(chosen.levels // 2, 1),
        finest=max(chosen.finest // 8, chosen.coarsest),
        log2_entries=max(chosen.log2_entries - 2, 4),
        features=chosen.features,
        width=max(chosen.width // 4, 1),
        precision=chosen.precision,
        **shared,
    )
    model = mipnerf360.Model(
        proposal=proposal if len(chosen.samples) > 1 else None,
        field=field,
        samples=tuple(chosen.samples),
        near=chosen.near,
        far=chosen.far,
        background=chosen.background,
        native=native,
    )
    return model, rendering.huber
