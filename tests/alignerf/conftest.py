"""A tiny scene and a training of it, for the tests of the stage `train`."""

import pytest

from tests import job_cases as cases


@pytest.fixture(scope="module")
def compiled_once(tmp_path_factory):
    """Programs are kept for the module's trainings, as between jobs of a workflow."""
    with cases.compiled_into(tmp_path_factory.mktemp("compiled")):
        yield


@pytest.fixture(scope="module")
def folder(compiled_once, tmp_path_factory):
    return cases.make_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def uninterrupted(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("uninterrupted")
    cases.run(folder, out)
    return out
