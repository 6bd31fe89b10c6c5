"""The version of this program: `alignerf.__version__`."""

import importlib.metadata
import tomllib

from alignerf.io import provenance

NAME = "why-blurry"


def version() -> str:
    """That of the checkout that this is, else of what is installed."""
    if provenance.PIPELINE != provenance.ROOT:
        return importlib.metadata.version(NAME)
    text = (provenance.ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)["project"]["version"]


__version__ = version()
