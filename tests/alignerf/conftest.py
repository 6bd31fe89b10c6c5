"""A tiny scene and a training of it, for the tests of the stage `train`."""

import pytest

from tests import job_cases as cases
from tests import kept_steps


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return cases.make_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def uninterrupted(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("uninterrupted")
    cases.run(folder, out)
    return out


@pytest.fixture(scope="module")
def keeps_steps():
    """The trainings of a module compile each job once: see tests/kept_steps.py."""
    with pytest.MonkeyPatch.context() as patched:
        kept_steps.use(patched)
        yield
