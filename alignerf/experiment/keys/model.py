"""Keys of `models`: a system of the registry each."""

from typing import Annotated, Union

import pydantic

from alignerf import systems

KINDS = systems.every()
USUAL = next(iter(KINDS))


def of_usual_kind(value):
    """Without a kind a model is a mip-NeRF 360."""
    return {"kind": USUAL} | value if isinstance(value, dict) else value


Models = Annotated[
    Union[tuple(KINDS.values())],  # noqa: UP007 (of a tuple)
    pydantic.Field(discriminator="kind"),
    pydantic.BeforeValidator(of_usual_kind),
]
