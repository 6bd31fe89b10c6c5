"""Which sections of a config's keys a stage's code reaches.

A change of a key's text, default or bound reruns the stages that reach its section: of
the others no source has changed.
"""

import re

import pytest

from alignerf.experiment import sources

JOB = {"model", "training"}
# No sections: what several of them have in common.
SHARED = {"__init__", "estimators", "key"}
EVERY = JOB | {"config", "flow", "scene"}
# {stage: sections}; of a stage that is not here, none.
REACHED = {
    # A training takes what facts decided, and these are told by the scene's keys too.
    "alignerf.train": JOB | {"scene"},
    "alignerf.render_views": JOB | {"scene"},
    "alignerf.align_test_poses": JOB | {"scene"},
    # Facts decide settings.
    "alignerf.facts": {"scene", "training"},
    "alignerf.poses": {"scene"},
    # The page says what the facts decided.
    "alignerf.page": {"scene", "training"},
    # It reads the photos of a scene once more.
    "alignerf.export": {"scene"},
    "alignerf.config": EVERY,
    # Programs of a whole config are compiled ahead.
    "alignerf.costs": EVERY,
}


@pytest.fixture
def stages(root):
    """Modules that the rules run."""
    text = "".join(
        path.read_text()
        for folder in ("workflow/rules", "alignerf/experiment/steps")
        for path in (root / folder).glob("*.*")
    )
    named = re.findall(r"(?:python -m |words\(\s*\")([\w.]+)", text)
    return sorted({*named})


def test_every_stage_of_the_list_is_run_by_a_rule(stages):
    assert set(REACHED) <= set(stages)


def test_a_stage_reaches_its_sections_alone(stages):
    for stage in stages:
        keys = [p for p in sources.reached(stage) if p.parent.name == "keys"]
        sections = {path.stem for path in keys} - SHARED
        assert sections == REACHED.get(stage, set()), stage


@pytest.mark.parametrize("stage", ["flow.align", "flow.decompose", "alignerf.verdict"])
def test_what_reads_no_key_does_not_depend_on_any(stage):
    assert not [p for p in sources.reached(stage) if p.parent.name == "keys"]
