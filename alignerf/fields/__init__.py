"""Fields map a Gaussian to density and, where asked, to values (colour, features).

Every field is a flax module with `__call__(gaussians, viewdirs) -> (density [rays,
samples], values [c, rays, samples])`; `viewdirs` None asks for density alone and
gives values None. A third argument, `fineness`, may hide what is fine in its input.
"""

from alignerf.fields import grid, mlp, nerf

KINDS = {"grid": grid.Grid, "mlp": mlp.Mlp, "nerf": nerf.Nerf}


def make(kind, **options):
    """The field of that kind; an unknown kind or option is a ValueError."""
    try:
        return KINDS[kind](**options)
    except KeyError:
        raise ValueError(
            f"field kind {kind!r}: not one of {', '.join(KINDS)}"
        ) from None
    except TypeError as error:
        raise ValueError(f"field {kind!r}: {error}") from None
