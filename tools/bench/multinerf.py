"""Loads google-research/multinerf, the peer, from a checkout of it.

It is mip-NeRF 360's released code. Needs `gin-config` beside our environment; what
only its file loaders import (rawpy, its own pycolmap, dm_pix) is stood in for.
"""

import contextlib
import functools
import importlib
import inspect
import pathlib
import sys
import types
import warnings

import jax

MODULES = [
    *("camera_utils", "configs", "coord", "datasets", "geopoly", "image", "math"),
    *("models", "ref_utils", "render", "stepfun", "train_utils", "utils"),
]


def load(path) -> types.SimpleNamespace:
    """The peer's modules by name (`stepfun`, `coord`, ...) from its checkout.

    Raises ValueError where the checkout or gin-config is missing.
    """
    path = pathlib.Path(path).resolve()
    if not (path / "internal" / "train_utils.py").is_file():
        raise ValueError(f"{path}: not a checkout of google-research/multinerf")
    try:
        gin = importlib.import_module("gin")
    except ImportError:
        raise ValueError("the peer needs the package gin-config") from None
    with _imports(path), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = {name: importlib.import_module(f"internal.{name}") for name in MODULES}
    where = pathlib.Path(found["stepfun"].__file__).parent.parent
    if where != path:
        raise ValueError(f"{path}: another checkout was loaded before, {where}")
    for module in found.values():
        relax(module)
    return types.SimpleNamespace(gin=gin, path=path, **found)


def relax(module):
    """Let a peer's code broadcast arrays of other ranks, which ours may not."""
    for name, value in list(vars(module).items()):
        if getattr(value, "__module__", None) != module.__name__:
            continue
        if inspect.isfunction(value):
            setattr(module, name, relaxed(value))
        elif inspect.isclass(value) and hasattr(value, "apply"):
            value.apply, value.init = relaxed(value.apply), relaxed(value.init)


def relaxed(function):
    """The same function, in which strictness about ranks is off."""

    @functools.wraps(function)
    def run(*args, **kwargs):
        with jax.numpy_rank_promotion("allow"):
            return function(*args, **kwargs)

    return run


@contextlib.contextmanager
def _imports(path):
    """Its folder on the path, and stand-ins for what only its file loaders need."""
    stubs = {"rawpy": types.ModuleType("rawpy")}
    # Its pycolmap is a namesake of the one that we use.
    stubs["pycolmap"] = types.ModuleType("pycolmap")
    stubs["pycolmap"].SceneManager = object
    try:
        importlib.import_module("dm_pix")
    except ImportError:
        stubs["dm_pix"] = types.ModuleType("dm_pix")
    hidden = {name: sys.modules.get(name) for name in stubs}
    before = list(sys.path)
    sys.modules.update(stubs)
    sys.path.insert(0, str(path))
    try:
        yield
    finally:
        sys.path[:] = before
        for name, module in hidden.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module
