"""Test files that a change reaches by what they import: what `make check` runs.

`python -m tests.reached FOLDER ...` prints them, the nearest first, without those of
the folders. Changed is what differs from origin/main, in a commit or not.
"""

import subprocess
import sys
from collections import defaultdict
from pathlib import Path

from alignerf.experiment import sources

ROOT = sources.ROOT
# Whatever has changed.
ALWAYS = ("tests/test_floors.py", "tests/test_ratchet.py")
# Of what is no Python.
BESIDE = {"Snakefile": "workflow", "README.md": "docs", "CONTRIBUTING.md": "docs"}


def git(*words):
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    return done.stdout.splitlines() if done.returncode == 0 else []


def changed():
    """Paths, from the project's folder; of data beside modules their package's."""
    (base, *_) = [*git("merge-base", "HEAD", "origin/main"), "HEAD"]
    found = git("diff", "--name-only", base)
    for path in map(Path, found + git("ls-files", "--others", "--exclude-standard")):
        package = path.parent / "__init__.py"
        yield path if path.suffix == ".py" or not (ROOT / package).exists() else package


def importers():
    """{file: files that import it}."""
    found = defaultdict(set)
    for top in ("alignerf", "flow", "tools", "tests"):
        for path in (ROOT / top).rglob("*.py"):
            for file in filter(None, map(sources.file_of, set(sources.imports(path)))):
                found[file].add(path)
            if "extensions.registered(" in path.read_text():
                for record in path.parent.glob("*.py"):
                    found[record].add(path)
    return found


def reached(paths):
    """Test files that import the paths, those that need the fewest steps first."""
    by, todo, seen = importers(), [ROOT / path for path in paths], {}
    for path in paths:
        top = BESIDE.get(str(path), path.parts[0])
        if path.suffix != ".py" and top in ("docs", "workflow"):
            todo += sorted((ROOT / "tests" / top).glob("test_*.py"))
    for file in todo:
        if file not in seen:
            seen[file] = True
            todo += sorted(by[file])
    names = [str(path.relative_to(ROOT)) for path in seen if path.exists()]
    return [name for name in names if Path(name).name.startswith("test_")]


if __name__ == "__main__":
    nearest = dict.fromkeys([*ALWAYS, *reached([*changed()])])
    print(*[name for name in nearest if not name.startswith(tuple(sys.argv[1:]))])
