"""The site: no dead link, a search that finds, and the demo's page in it."""

import importlib.util
import json
import re
import shutil
import tomllib
from html.parser import HTMLParser
from urllib.parse import unquote

import pytest
from packaging import requirements

from tools.docs import site

PAGE = """<a href="tables/views.csv">views</a> <a href="export/">export</a>
<a href="#look">look</a> <a href="https://example.org">there</a>
<a href="../other/secret.csv">no</a>"""


@pytest.fixture
def demo(tmp_path):
    """A finished scene's page, with a file beside it."""
    folder = tmp_path / "results/courtyard"
    (folder / "tables").mkdir(parents=True)
    (folder / "tables/views.csv").write_text("view\n")
    (tmp_path / "results/other").mkdir()
    (tmp_path / "results/other/secret.csv").write_text("view\n")
    (folder / "index.html").write_text(PAGE)
    return folder / "index.html"


def test_the_demos_page_comes_with_its_files_and_no_others(demo, tmp_path):
    docs = tmp_path / "docs"
    (docs / "howto").mkdir(parents=True)
    (docs / "start.md").write_text(f"Open it.\n{site.MARK}\n")
    (docs / "howto/verdict.md").write_text(site.MARK)
    assert site.add_demo(demo, docs)
    made = {p.relative_to(docs / "demo").as_posix() for p in docs.rglob("demo/**/*.*")}
    assert made == {"index.html", "tables/views.csv"}
    assert "](demo/index.html)" in (docs / "start.md").read_text()
    assert "](" + "../demo/index.html)" in (docs / "howto/verdict.md").read_text()


def test_without_a_demo_pages_stay_as_they_are(tmp_path):
    (tmp_path / "start.md").write_text(site.MARK)
    assert not site.add_demo(tmp_path / "none.html", tmp_path)
    assert (tmp_path / "start.md").read_text() == site.MARK


def test_a_link_to_a_file_outside_docs_is_its_text(tmp_path):
    docs, pages = tmp_path / "docs", tmp_path / "pages"
    (docs / "one").mkdir(parents=True)
    (docs / "a.csv").touch()
    (tmp_path / "code.py").touch()
    kept = "[a](../a.csv), [gone](../../gone.py)"
    (docs / "one/page.md").write_text(f"[code.py](../../code.py), {kept}")
    shutil.copytree(docs, pages)
    site.unlink_files(docs, pages)
    assert (pages / "one/page.md").read_text() == f"`code.py`, {kept}"


def test_without_the_generator_it_says_what_installs_it(tmp_path, monkeypatch):
    monkeypatch.setattr(site, "GENERATOR", "no_such_generator")
    with pytest.raises(ValueError, match="no_such_generator is not installed: `make"):
        site.main(["--root", str(tmp_path)])


def test_the_pins_are_of_what_the_project_asks_for(root):
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    lock = (root / "requirements-site.lock").read_text()
    locked = dict(re.findall(r"^([\w.-]+)==(\S+)", lock, re.MULTILINE))
    extra = project["optional-dependencies"]["site"]
    asked = [requirements.Requirement(one).name for one in extra]
    assert set(asked) <= set(locked)
    assert f"'%s\\n' {' '.join(asked)} |" in (root / "Makefile").read_text()
    main = (root / "requirements.lock").read_text()
    pinned = dict(re.findall(r"^([\w.-]+)==(\S+)", main, re.MULTILINE))
    assert {name: pinned[name] for name in locked if name in pinned} == {
        name: version for name, version in locked.items() if name in pinned
    }


@pytest.fixture(scope="module")
def built(root, tmp_path_factory):
    """The site's folder, with a demo's page."""
    if importlib.util.find_spec(site.GENERATOR) is None:
        pytest.skip(f"no {site.GENERATOR}: `make site` installs it")
    folder = tmp_path_factory.mktemp("site")
    page = folder / "courtyard/index.html"
    page.parent.mkdir()
    page.write_text("<h1>the demo's page</h1>")
    out = folder / "out"
    site.main(["--root", str(root), "--demo", str(page), "--out", str(out)])
    return out


def test_a_dead_link_ends_the_build(root, tmp_path):
    pytest.importorskip(site.GENERATOR)
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs/README.md").write_text("# One\n\n[gone](gone.md)\n")
    config = "site_name: one\ntheme: {name: mkdocs}\nplugins: [search]\n"
    (tmp_path / "mkdocs.yml").write_text(config)
    with pytest.raises(ValueError, match=r"gone\.md"):
        site.main(["--root", str(tmp_path)])
    assert not (tmp_path / "site").exists()


@pytest.mark.parametrize("word", ["oracle", "refine", "Polycam"])
def test_the_search_finds(built, word):
    index = json.loads((built / "search/search_index.json").read_text())
    found = {
        entry["location"].partition("#")[0]
        for entry in index["docs"]
        if word.lower() in f"{entry['title']} {entry['text']}".lower()
    }
    assert "reference/glossary/" in found
    assert len(found) >= 3


def test_no_link_of_the_site_is_dead(built):
    names = {}
    for path in built.rglob("*.html"):
        names[path] = Links(path.read_text(encoding="utf-8"))
    assert built / "demo/index.html" in names
    count = 0
    for path, page in names.items():
        # The page of a missing page may lie anywhere: its links are absolute.
        for link in page.links if path.name != "404.html" else ():
            name, _, anchor = unquote(link).partition("#")
            target = (path.parent / name).resolve() if name else path
            target = target / "index.html" if target.is_dir() else target
            assert target.exists(), f"{path}: {link}"
            if anchor and target.suffix == ".html":
                assert anchor in names[target].ids, f"{path}: {link}"
            count += 1
    assert count >= 1000


class Links(HTMLParser):
    """Links and pictures of a page that lead to this site, and the ids in it."""

    def __init__(self, text):
        super().__init__()
        self.links, self.ids = [], {""}
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.ids.add(found.get("id"))
        link = found.get("href") or found.get("src")
        if link and link != "#" and not re.match(r"[a-z]+:|//", link):
            self.links.append(link.partition("?")[0])
