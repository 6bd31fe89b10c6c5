"""What a key is: a field with its default, its meaning and its bounds."""

import difflib
import os
import re
from pathlib import Path
from typing import Annotated

import pydantic

from alignerf.io import faults

# Of a key that every config has to give; of one that is there only where it is given.
REQUIRED = object()
# Of models, methods and variants: they become folders, and columns of tables.
NAME = r"^[A-Za-z0-9][A-Za-z0-9_]{0,99}\Z"
MAX_NAMES = 10000
DATA = re.compile(r"\$\{ALIGNERF_DATA:-([^{}]*)\}")
# The least and the largest that float32 has with all its digits: JAX computes in it,
# and takes what is smaller for 0.
LEAST, LARGEST = 2.0**-126, 2.0**128 - 2.0**104
# As pydantic calls them.
BOUNDS = {"least": "ge", "most": "le", "above": "gt"}

# Keys and values of earlier versions: what they are called now.
RENAMED = {
    "windows": "crops",
    "zoom": "crop",
    "judged": "external_renders",
    "refine": "pose_optimization",
    "share": "fraction",
    "delay_share": "delay_fraction",
    "finetune_share": "finetune_fraction",
    "hold_share": "hold_fraction",
    "pretrain_share": "pretrain_fraction",
    "proposal_share": "proposal_fraction",
    "finest": "max_resolution",
    "coarsest": "base_resolution",
    "log2_entries": "log2_hashmap_size",
    "least_move_px": "min_move_px",
    "least_registered": "min_registered",
    "least_train_views": "min_train_views",
}
REMOVED = {
    "refine_keypoints": ": keypoints are not aligned by patches any more; the second "
    "adjustment of COLMAP's poses is `adjust_again`",
    "decided": ": what facts decide is null",
    "depth_kind": ": `depth` is along the optical axis",
    "depth_scale": ": `depth` is in the unit of the cameras",
    "dilation": ": the method `aligned_loss: {}` replaces dilated patches",
    "published": ": `published_table` shows what a paper's table prints",
    "max_rounds": ": `rounds` is a number; two are enough",
    "renders": ": a method has `external: {renders: FOLDER}`, a scene "
    "`external_renders`",
    "warm_start": ": each round trains from scratch, as in the paper",
    "regimes": ": `snakemake comparison` has its rows, `table4` those of the paper",
}
RENAMED_VALUES = {"judged": "external_renders", "given": "input"}
# Programs, and the source that reads what they write.
READ_BY = {
    "nerfstudio": "transforms",
    "instant-ngp": "transforms",
    "instant_ngp": "transforms",
    "colmap": "mipnerf360",
    "nerf_synthetic": "blender",
}


class Keys(pydantic.BaseModel):
    """A section of a config: nothing is converted, and no other key taken."""

    model_config = pydantic.ConfigDict(
        strict=True,
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        # The other one knows no \Z, and nothing that looks ahead.
        regex_engine="python-re",
        defer_build=True,
    )

    @classmethod
    def default(cls, name):
        """A key's default, also of a class that needs other keys."""
        return cls.model_fields[name].get_default(call_default_factory=True)

    @property
    def given(self):
        """{key: value} of the keys that a config says itself."""
        return {name: getattr(self, name) for name in self.model_fields_set}

    def __hash__(self):
        """By value, as they are equal."""
        return hash(self.model_dump_json())

    @pydantic.model_validator(mode="before")
    @classmethod
    def check_known(cls, values):
        """ValueError for the first unknown key, with the one that it may stand for."""
        names = cls.model_fields
        for key in values if isinstance(values, dict) else ():
            if key not in names:
                word = key[:100] if isinstance(key, str) else ""
                near = difflib.get_close_matches(word, names, n=1)
                hint = f", perhaps {near[0]!r}" if near else ""
                if RENAMED.get(word) in names:
                    hint = f": it is called {RENAMED[word]!r} now"
                hint = REMOVED.get(word, hint)
                raise ValueError(
                    f"{faults.shown(key, 100)} is no key of this section{hint}"
                )
        return values

    def paths(self):
        """{place: path} of all files and folders that it names, at any depth."""
        return dict(named_in(self))

    def faults(self):
        """Yield (key, reason) of what does not go together; key "" is the section."""
        return ()

    @pydantic.model_validator(mode="after")
    def check_faults(self):
        """ValueError for the first fault."""
        for where, reason in self.faults():
            raise ValueError(f"{where}: {reason}" if where else reason)
        return self

    @pydantic.model_validator(mode="after")
    def check_digits(self):
        """ValueError for a number that float32 has not: it would fail far from here."""
        for key, value in self:
            for one in value if isinstance(value, list) else [value]:
                if isinstance(one, float) and one and not LEAST <= abs(one) <= LARGEST:
                    raise ValueError(
                        f"{key}: {one!r} should be 0, or from {LEAST:.1e} to "
                        f"{LARGEST:.1e}, as float32 has no others"
                    )
        return self


class Bounds:
    """Bounds of a key's numbers, wherever they stand in its type: in a list too."""

    def __init__(self, limits):
        self.limits = limits

    def __get_pydantic_core_schema__(self, source, handler):
        return self.put_on(handler(source))

    def put_on(self, part):
        """A part of pydantic's own schema with the bounds on each number in it."""
        if part["type"] in ("int", "float"):
            return part | self.limits
        for inner in {"schema", "items_schema"} & part.keys():
            part = part | {inner: self.put_on(part[inner])}
        if "choices" in part:
            part = part | {"choices": list(map(self.put_on, part["choices"]))}
        return part


def key(default=REQUIRED, what="", *, length=None, **bounds):
    """A field of a class of keys: its default, its meaning, its bounds.

    default: where it is a class, that class's own. length: the least and the most
    entries of a list. bounds: also what else a field of pydantic takes.
    """
    limits = {BOUNDS[k]: bounds.pop(k) for k in BOUNDS.keys() & bounds.keys()}
    if length:
        bounds["min_length"], bounds["max_length"] = length
    if isinstance(default, type):
        bounds["default_factory"] = default
    elif default is not REQUIRED:
        bounds["default"] = default
    field = pydantic.Field(description=what or None, **bounds)
    if limits:
        field.metadata.append(Bounds(limits))
    return field


class File(str):
    """The path of a file or a folder that a key names."""

    __slots__ = ()


def named_in(values, *above):
    """Yield (place, path) of a section, or of a mapping; above: the keys above it."""
    for name, value in dict(values).items():
        if isinstance(value, Keys | dict):
            yield from named_in(value, *above, name)
        elif isinstance(value, File):
            yield ".".join((*above, name)), value


def home(path):
    """A path with `~` and ${ALIGNERF_DATA:-default} written out, as a shell does it.

    The variable names the folder of real data, the default stands in the config.
    """
    given = os.environ.get("ALIGNERF_DATA")
    path = DATA.sub(lambda found: given or found[1], path)
    try:
        return File(Path(path).expanduser())
    except RuntimeError:
        raise ValueError(f"{path}: no such user's home") from None


# Type of a key that names a file or a folder.
PATH = Annotated[str, pydantic.Field(pattern=r"\S"), pydantic.AfterValidator(home)]


def named(kind, pattern=NAME):
    """Type of a mapping from names to instances of a class."""
    name = Annotated[str, pydantic.Field(pattern=pattern)]
    size = pydantic.Field(min_length=1, max_length=MAX_NAMES)
    return Annotated[dict[name, kind], size]


def learning_rates(first, last):
    what = "first and last, log-linear between"
    return key([first, last], what, above=0, most=10, length=(2, 2))


# The fault of a section with steps and a budget.
ONE_LENGTH = "budget_min", "not beside steps, choose one"


def budget(what):
    return key(None, what, above=0, most=14400)
