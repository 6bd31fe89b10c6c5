"""One set of versions: pip's lock, conda's environment and what the project asks."""

import re
import sys
import tomllib
from pathlib import Path

import yaml
from packaging import requirements

import alignerf

ROOT = Path(__file__).resolve().parent.parent


def locked():
    """{package: version} of the lock."""
    text = (ROOT / "requirements.lock").read_text()
    pins = re.findall(r"^([A-Za-z0-9_.-]+)==([^\s;\\]+)", text, re.MULTILINE)
    return {canonical(name): version for name, version in pins}


def conda():
    """(lines of what pip installs, the other packages)."""
    found = yaml.safe_load((ROOT / "environment.yml").read_text())["dependencies"]
    (pip,) = (entry["pip"] for entry in found if isinstance(entry, dict))
    return pip, [entry for entry in found if isinstance(entry, str)]


def project():
    """What pyproject.toml says of the package."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def required(*extras):
    """What is asked for: by all users, and by these extras."""
    found = project()["optional-dependencies"]
    more = [one for extra in extras for one in found[extra]]
    return [*map(requirements.Requirement, [*project()["dependencies"], *more])]


def asked():
    """Names that pyproject.toml lists, for judging, training and developing."""
    return [one.name for one in required("train", "dev")]


def canonical(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def test_conda_installs_what_the_lock_pins():
    """`make lock` writes both."""
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    assert conda()[0] == [line.rstrip(" \\") for line in lines if line[0] != " "]
    assert {canonical(name) for name in asked()} <= locked().keys()


def test_the_project_says_where_it_was_tried():
    systems = [c for c in project()["classifiers"] if c.startswith("Operating System")]
    assert systems == ["Operating System :: POSIX :: Linux"]
    assert "Tested on Linux" in (ROOT / "docs/start.md").read_text()


def test_every_dependency_has_a_lower_bound_that_the_lock_meets():
    extras, lock = project()["optional-dependencies"], locked()
    for one in required(*extras):
        if one.name == project()["name"]:
            assert set(one.extras) <= extras.keys()
            continue
        assert [bound.operator for bound in one.specifier] == [">="], one
        if version := lock.get(canonical(one.name)):
            assert version in one.specifier, one


def test_all_say_the_same_version():
    """pyproject.toml, CITATION.cff, the first of CHANGELOG.md, and the program."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    heads = re.findall(r"^## (.+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert heads[0] == f"[{citation['version']}] - {citation['date-released']}"
    assert alignerf.__version__ == citation["version"]


def test_every_pin_has_a_hash():
    text = (ROOT / "requirements.lock").read_text()
    entries = re.split(r"\n(?=\S)", text.strip())
    pins = [entry for entry in entries if not entry.startswith("#")]
    assert len(pins) >= len(locked())
    assert all("--hash=sha256:" in entry for entry in pins)


def test_python_is_one_that_the_project_supports():
    least = project()["requires-python"].removeprefix(">=")
    (python,) = (e for e in conda()[1] if e.startswith("python"))
    assert python == f"python={least}"


def test_all_imports_are_asked_for():
    """What the code imports is a dependency of ours, not of a dependency."""
    modules = {"cv2": "opencv-contrib-python-headless", "PIL": "pillow"}
    modules |= {"skimage": "scikit-image", "yaml": "pyyaml"}
    text = "\n".join(
        path.read_text()
        for pattern in ("alignerf/**/*.py", "flow/**/*.py", "Snakefile")
        for path in ROOT.glob(pattern)
    )
    pattern = r"^(?:import|from) (\w+)[\w.]*(?: import .*| as \w+)?$"
    found = set(re.findall(pattern, text, re.MULTILINE))
    names = {canonical(modules.get(name, name)) for name in found}
    standard = {canonical(name) for name in sys.stdlib_module_names}
    ours = {"alignerf", "flow"}
    assert names - standard - ours <= {canonical(name) for name in asked()}


def test_who_judges_installs_no_more_than_that_imports():
    """tests/alignerf/cli/test_light.py judges without what is left out."""
    heavy = {"jax", "flax", "optax", "snakemake", "matplotlib", "beartype"}
    assert not heavy & {one.name for one in required()}
    assert {one.name for one in required("judge")} == {one.name for one in required()}


def test_who_trains_on_a_gpu_installs_what_trains():
    (train, jax) = project()["optional-dependencies"]["gpu"]
    assert (train, jax.startswith("jax[cuda12]")) == ("why-blurry[train]", True)


def test_no_path_leads_out_of_the_checkout():
    """Where data lies is a user's to say."""
    for package in ("alignerf", "flow"):
        for path in (ROOT / package).rglob("*.py"):
            assert "../" not in path.read_text(), path
