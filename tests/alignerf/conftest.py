"""A tiny scene and a training of it, for the tests of the stage `train`."""

import pytest

from tests import job_cases as cases


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return cases.make_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def uninterrupted(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("uninterrupted")
    cases.run(folder, out)
    return out
