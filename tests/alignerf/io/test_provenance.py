"""Where a table comes from: what is known is told, what is not is null."""

import hashlib
import json
import subprocess

import pytest

from alignerf.io import provenance


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout whose sources these seem to be; commits are asked anew."""
    folder = tmp_path / "checkout"
    source = folder / "alignerf" / "io" / "provenance.py"
    source.parent.mkdir(parents=True)
    source.write_text("one = 1\n")
    monkeypatch.setattr(provenance, "ROOT", folder)
    monkeypatch.setattr(provenance, "__file__", str(source))
    provenance.commit.cache_clear()
    provenance.lock.cache_clear()
    yield folder
    provenance.commit.cache_clear()
    provenance.lock.cache_clear()


def git(folder, *arguments):
    who = ("-c", "user.name=a", "-c", "user.email=a@example.org")
    command = ["git", "-C", str(folder), *who, *arguments]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def commit_all(folder):
    git(folder, "init", "-q")
    git(folder, "add", ".")
    git(folder, "commit", "-q", "-m", "first")
    return git(folder, "rev-parse", "HEAD")


def test_the_commit_and_whether_files_differ(checkout):
    head = commit_all(checkout)
    assert provenance.commit() == head
    # What git does not know is no source.
    (checkout / "results.csv").write_text("1")
    provenance.commit.cache_clear()
    assert provenance.commit() == head
    (checkout / "alignerf/io/provenance.py").write_text("one = 2\n")
    assert provenance.commit() == head
    provenance.commit.cache_clear()
    assert provenance.commit() == f"{head}-dirty"


def test_another_repository_s_variables_change_nothing(checkout, tmp_path, monkeypatch):
    head = commit_all(checkout)
    monkeypatch.setenv("GIT_DIR", str(tmp_path / "nowhere"))
    assert provenance.commit() == head


def test_sources_that_are_no_checkout_have_no_commit(checkout, monkeypatch):
    assert provenance.commit() is None
    # Installed below another project's checkout: its commit says nothing.
    git(checkout, "init", "-q")
    provenance.commit.cache_clear()
    assert provenance.commit() is None
    commit_all(checkout)
    monkeypatch.setenv("PATH", "")
    provenance.commit.cache_clear()
    assert provenance.commit() is None


def test_the_lock_is_the_file_s_hash(checkout):
    assert provenance.lock() is None
    (checkout / "requirements.lock").write_bytes(b"numpy==1\n")
    provenance.lock.cache_clear()
    assert provenance.lock() == hashlib.sha256(b"numpy==1\n").hexdigest()[:16]
    assert set(provenance.facts()) == {"commit", "lock", "environment"}


def write_config(path, **seeds):
    lines = [f"  {name}: {{seed: {seed}}}\n" for name, seed in seeds.items()]
    path.write_text("seed: 0\nscenes:\n" + "".join(lines))
    return path


def test_trainings_seeds_and_devices_are_gathered(checkout, tmp_path):
    old = {"path": "old.json", "commit": None, "lock": None, "device": "cpu"}
    new = {"path": "new.json", "device": "H200", "commit": "abc", "lock": "12"}
    configs = [write_config(tmp_path / "one.yaml", yard=5)]
    configs.append(write_config(tmp_path / "two.yaml", yard=3, garden=5))
    found = provenance.describe([old, new], configs, seeds=[8], devices=["a cpu"])
    assert found == json.loads(provenance.as_json(found))
    assert found["device"] == ["H200", "a cpu", "cpu"]
    assert found["seeds"] == [3, 5, 8]
    assert list(found["configs"]) == [str(path) for path in configs]
    # What the files said then: they may be another experiment's later.
    assert found["configs"][str(configs[0])]["scenes"] == {"yard": {"seed": 5}}
    assert (found["commit"], found["lock"]) == (None, None)
    assert found["trainings"] == [old, new]


def test_what_a_training_does_not_tell_is_null(tmp_path):
    path = tmp_path / "timing.json"
    path.write_text(json.dumps({"device": "cpu", "steps": 3}))
    told = {"commit": None, "lock": None, "device": "cpu", "environment": None}
    assert provenance.of_training(path) == told
    path.write_text(json.dumps(told | {"commit": "abc", "lock": "12"}))
    assert provenance.of_training(path) == told | {"commit": "abc", "lock": "12"}


@pytest.mark.parametrize("text", ["", "[1]", "3", '{"device": 3}', "[" * 100_000])
def test_a_timing_that_is_none_is_named(tmp_path, text):
    path = tmp_path / "timing.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"timing\.json: "):
        provenance.of_training(path)


@pytest.mark.parametrize("text", ["", "a: [", "[1]", "scenes: {a: {}}", "scenes: 3"])
def test_a_config_that_is_none_is_named(tmp_path, text):
    path = tmp_path / "config.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"config\.yaml: ") as told:
        provenance.describe([], [path])
    assert "\n" not in str(told.value)


def test_variables_that_may_change_a_digit_are_noted():
    environ = {"OPENCV_IPP": "disabled", "XLA_FLAGS": "--a=1 --b", "HOME": "/home/me"}
    told = provenance.environment(environ)
    assert told == "XLA_FLAGS='--a=1 --b' OPENCV_IPP=disabled"
    assert provenance.environment({"XLA_FLAGS": ""}) is None
