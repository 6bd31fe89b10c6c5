"""The library is made once, and where it cannot be, JAX's own code is used."""

import re
from pathlib import Path

import jax
import pytest

from alignerf.io import machine
from alignerf.kernels import build, calls


@pytest.fixture
def anew(monkeypatch, tmp_path):
    """As in a new process, with an empty cache."""
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    build.library.cache_clear()
    calls.register.cache_clear()
    yield tmp_path / "alignerf"
    build.library.cache_clear()
    calls.register.cache_clear()


def test_a_missing_compiler_is_said_and_not_an_error(anew, monkeypatch, caplog):
    monkeypatch.setenv("CXX", "no-such-compiler")
    assert not calls.use("auto")
    assert calls.name_of("auto") == "jax"
    (line,) = (r.getMessage() for r in caplog.records)
    assert "no-such-compiler" in line
    assert "JAX's own code is used" in line
    with pytest.raises(ValueError, match=r"training\.kernels: native"):
        calls.use("native")
    assert not list(anew.glob("*.so"))


def test_a_compiler_that_fails_leaves_nothing_behind(anew, monkeypatch, caplog):
    monkeypatch.setenv("CXX", "false")
    assert not calls.use("auto")
    assert "false: ended with 1" in caplog.text
    assert not list(anew.iterdir())


def test_a_cache_that_cannot_be_written_is_said(anew, monkeypatch, caplog):
    anew.write_text("a file where a folder should be")
    assert not calls.use("auto")
    assert str(anew) in caplog.text


def test_nothing_is_made_where_it_is_not_wanted(anew, monkeypatch):
    assert not calls.use("jax")
    monkeypatch.setattr(jax, "default_backend", lambda: "cuda")
    assert not calls.use("auto")
    with pytest.raises(ValueError, match="native is for a CPU: cuda"):
        calls.use("native")
    assert not anew.exists()


@pytest.mark.whole
def test_it_lies_beside_the_compiled_programs(anew, monkeypatch, tmp_path):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "programs"))
    if build.library() is None:
        pytest.skip("no C++ compiler: the kernels cannot be made")
    (made,) = (tmp_path / "programs").iterdir()
    assert made.name.startswith(f"kernels-{machine.processor()}-")


def test_all_that_is_included_changes_the_digest():
    """A header that is not among the sources would leave an old library in use."""
    named = {path.name for path in build.SOURCES}
    own = re.findall(
        r'#include "(\w+\.h)"', "".join(map(Path.read_text, build.SOURCES))
    )
    assert own
    assert set(own) <= named
    assert named == {p.name for p in Path(build.__file__).parent.glob("*.[ch]*")}
