"""The command that writes complete configs, and looks at them."""

import json

import pytest
import yaml

from alignerf import config
from alignerf.experiment import plan
from alignerf.io import faults


def test_a_complete_config_is_written_in_its_order(
    demo, experiment_of, tmp_path, capsys
):
    experiment = experiment_of(demo)
    text = plan.complete_config(experiment, "courtyard")
    config.main(["--config", text, "--out", str(tmp_path / "config.yaml")])
    found = yaml.safe_load((tmp_path / "config.yaml").read_text())
    assert found == json.loads(text)
    assert list(found["methods"]) == list(demo["methods"])
    config.main(["--check", str(tmp_path / "config.yaml")])
    trainings = len(experiment.trainings("courtyard"))
    asked = f"ok: 1 scene, {len(demo['methods'])} methods, {trainings} trainings\n"
    assert capsys.readouterr().out == asked


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[1, 2]", "top level: a config is a mapping"),
        ("", "'scenes' is missing"),
        ("scenes: {a: 1, a: 2}", "key 'a' stands twice, see line 1"),
        (
            "scenes: {a: {source: courtyard}}\nmethods: {m: {rounds: 2.0}}",
            "rounds: 2.0",
        ),
    ],
)
def test_a_fault_is_one_line(tmp_path, capsys, text, reason):
    path = tmp_path / "a.yaml"
    path.write_text(text)
    assert faults.exit_code(config.main, ["--check", str(path)]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert reason in error


@pytest.mark.parametrize(
    "arguments", [[], ["--config", "{}"], ["--out", "a.yaml"]], ids=" ".join
)
def test_arguments_that_ask_for_nothing_are_refused(arguments):
    with pytest.raises(ValueError, match="--config"):
        config.main(arguments)
