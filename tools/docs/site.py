"""Build the pages as a site with a search: `make site`, or `python -m tools.docs.site`.

The demo's page, which `make run` has made, becomes a part of it with the files that it
links to; without it the site is built all the same. A dead link ends the build; a link
to a file of the project outside docs/ is its text there.
"""

import argparse
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from urllib.parse import unquote

from alignerf.io import atomic, faults

GENERATOR = "properdocs"
# Where the demo's page lies in the site, and where pages name it.
DEMO, MARK = "demo/index.html", "<!-- demo -->"
PAGE = re.compile(r'data-doc href="[^"]*/docs/([\w/]+)\.md(#[\w-]+)?"')
OUTWARD = re.compile(r"\[([^]]+)\]\((\.\./[^)\s]+)\)")
LINK = re.compile(r'<a href="(?![a-z]+:|#)([^"#?]+)"')


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", default=".", type=Path, help="the project's folder")
    parser.add_argument(
        "--demo",
        default="results/courtyard/index.html",
        type=Path,
        help="the demo's page; results/courtyard/index.html",
    )
    parser.add_argument("--out", default="site", type=Path, help="folder, written")
    args = parser.parse_args(argv)
    if importlib.util.find_spec(GENERATOR) is None:
        raise ValueError(f"{GENERATOR} is not installed: `make site` does so")
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(args.root / "mkdocs.yml", folder)
        pages = Path(folder) / "docs"
        shutil.copytree(args.root / "docs", pages)
        unlink_files(args.root / "docs", pages)
        found = add_demo(args.root / args.demo, pages)
        with atomic.replace_folder(args.root / args.out) as made:
            build(Path(folder), made)
    print(f"{args.out}/index.html" + ("" if found else ", without the demo's page"))


def unlink_files(docs, pages):
    """Links to the project's files outside `docs` become their texts, in `pages`."""
    inside = docs.resolve()

    def text_of(link, folder):
        target = (folder / link[2]).resolve()
        out = target.is_file() and not target.is_relative_to(inside)
        return f"`{link[1]}`" if out else link[0]

    for path in pages.rglob("*.md"):
        folder = inside / path.parent.relative_to(pages)
        text = path.read_text(encoding="utf-8")
        unlinked = OUTWARD.sub(lambda link, at=folder: text_of(link, at), text)
        path.write_text(unlinked, encoding="utf-8")


def add_demo(page, docs):
    """The demo's page, and the files that it links to; whether there is one."""
    if not page.is_file():
        return False
    to = docs / DEMO
    to.parent.mkdir()
    text = page.read_text(encoding="utf-8")
    for name in map(unquote, LINK.findall(text)):
        source = (page.parent / name).resolve()
        if source.is_relative_to(page.parent.resolve()) and source.is_file():
            (to.parent / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, to.parent / name)
    # Pages lie beside it here, as folders of the site.
    to.write_text(PAGE.sub(r'href="../\1/\2"', text), encoding="utf-8")
    for path in docs.rglob("*.md"):
        shown = path.read_text(encoding="utf-8")
        link = Path(os.path.relpath(to, path.parent)).as_posix()
        said = f"[The page of a finished run, live]({link})."
        path.write_text(shown.replace(MARK, said), encoding="utf-8")
    return True


def build(folder, out):
    """Run the generator; its warnings, dead links among them, are errors."""
    config = str(folder / "mkdocs.yml")
    command = [sys.executable, "-m", GENERATOR, "build", "--strict", "-f", config]
    done = subprocess.run(
        [*command, "-d", str(out.resolve())],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        lines = f"{done.stdout}\n{done.stderr}".splitlines()
        told = [line for line in lines if line.startswith(("WARNING", "ERROR"))]
        raise ValueError("; ".join(told or lines[-1:]).replace(str(folder), "."))


if __name__ == "__main__":
    faults.run(main)
