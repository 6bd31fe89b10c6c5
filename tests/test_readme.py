"""The README: nothing left to fill in, and every file that it names exists."""

import re
import shutil
import subprocess


def test_links_and_paths_exist(root):
    text = (root / "README.md").read_text()
    assert "@@" not in text
    links = re.findall(r"\]\(([^)#:]+)\)", text)
    named = re.findall(r"`((?:alignerf|flow|workflow)/[\w./]+)`", text)
    assert len(links) >= 1
    assert len(named) >= 10
    for path in links + named:
        assert (root / path).exists(), path


def test_make_targets_exist(root):
    targets = re.findall(r"^(\w+):", (root / "Makefile").read_text(), re.MULTILINE)
    named = re.findall(r"^    make (\w+)", (root / "README.md").read_text(), re.M)
    assert {"run", "test"} <= set(named) <= set(targets)


def test_make_clean_leaves_what_is_tracked(root, tmp_path):
    shutil.copy(root / "Makefile", tmp_path)
    kept = {"results/README.md", "results/published/means.csv"}
    made = {"results/tradeoff.csv", "results/courtyard/a.png", "results/.jax_cache/b"}
    for name in kept | made | {".snakemake/log"}:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    subprocess.run(["make", "clean"], cwd=tmp_path, check=True, capture_output=True)
    left = {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()}
    assert left == kept | {"Makefile"}
