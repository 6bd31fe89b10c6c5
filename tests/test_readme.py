"""The README: nothing left to fill in, and every file that it names exists."""

import re


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
