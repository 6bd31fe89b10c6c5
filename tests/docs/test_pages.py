"""README and pages: their tables are their CSVs', and all that they name exists."""

import ast
import re
import shutil

import pandas as pd
import pytest
import yaml

from alignerf import causes
from tools.docs import tables

README_LINES = 120
LINE_WIDTH = 110
# Of the pages that a user reads, and lines of one that tells how something is done.
WORDS, HOWTO_LINES = 7_500, 60
OF_USERS = ("start.md", "howto/*.md", "explain/*.md", "reference/glossary.md")
HEAD = {
    "commit": r"[0-9a-f]{7,40}",
    "lock": r"[0-9a-f]{16}|none",
    "machine": r"\S.*",
    "command": r"\S.*",
    "measured": r"\d{4}-\d\d-\d\d",
}
LINK = re.compile(r"\]\(([^)\s]+)\)")
# What a user reads is American; names of files, as `learnt/`, are as they are.
BRITISH = re.compile(
    r"\b(?:[a-z]*colour|grey|[a-z]*cent(?:re|ring)|learnt|neighbour|metres?\b|(?:un)?spoilt"
    r"|behaviour|artefact|analys(?:ed?|ing)\b|cancelled|label(?:led|ling)|model(?:led|ling)"
    r"|[a-z]*(?:normal|optim|raster|initial|minim|maxim|recogn|regular|general|synchron"
    r"|summar|visual|quanti)is[eai])[a-z]*\b",
    re.IGNORECASE,
)
CODE = re.compile(r"`[^`\n]*`|^    .*|\]\([^)]*\)", re.MULTILINE)


@pytest.fixture(scope="module")
def pages(root):
    """Path -> text of all that a user reads."""
    beside = ("README.md", "CONTRIBUTING.md", "results/README.md")
    paths = [*root.glob("docs/**/*.md"), *(root / name for name in beside)]
    return {path: path.read_text() for path in paths}


@pytest.fixture
def copy(root, tmp_path):
    """README and docs in a folder of their own, with what they quote."""
    shutil.copytree(root / "docs", tmp_path / "docs")
    for name in ("README.md", "Makefile", "Snakefile"):
        shutil.copy(root / name, tmp_path)
    (tmp_path / tables.ACCURACY).parent.mkdir(parents=True)
    shutil.copy(root / tables.ACCURACY, tmp_path / tables.ACCURACY)
    return tmp_path


def test_the_tables_are_as_their_csvs_say(root, capsys):
    code = tables.main(["--root", str(root), "--check"])
    assert (capsys.readouterr().out, code) == ("", 0)


def test_a_changed_value_is_named_and_then_written(copy, capsys):
    path = copy / "docs/measured/misalignment.csv"
    text = path.read_text()
    (value,) = re.findall(r"^adjusted_cameras,none,(?:[\d.]+,){3}([\d.]+)", text, re.M)
    path.write_text(text.replace(f",{value},", ",99.97,"))
    arguments = ["--root", str(copy)]
    assert tables.main([*arguments, "--check"]) == 1
    assert capsys.readouterr().out.split()[:3] == [
        *("docs/evidence/fixes.md:", "table", "misalignment")
    ]
    assert "99.97" not in (copy / "docs/evidence/fixes.md").read_text()
    assert tables.main(arguments) == 0
    assert "| 99.97 |" in (copy / "docs/evidence/fixes.md").read_text()
    assert tables.main([*arguments, "--check"]) == 0


def test_every_csv_is_shown_or_listed_and_every_table_shown(root, pages):
    specs = yaml.safe_load((root / tables.MEASURED / "tables.yaml").read_text())
    marks = [mark for text in pages.values() for mark in tables.MARK.findall(text)]
    shown = {name for _, kind, name, *_ in marks if kind == "table"}
    assert shown == set(specs)
    used = {specs[name].get("csv", name) for name in shown}
    links = LINK.findall(pages[root / tables.MEASURED / "README.md"])
    used |= {link.removesuffix(".csv") for link in links if link.endswith(".csv")}
    assert used == {path.stem for path in (root / tables.MEASURED).glob("*.csv")}


def test_every_csv_says_where_it_comes_from(root):
    paths = sorted((root / tables.MEASURED).glob("*.csv"))
    assert len(paths) >= 14
    for path in paths:
        lines = path.read_text().splitlines()
        for line, (name, pattern) in zip(lines, HEAD.items(), strict=False):
            assert re.fullmatch(f"# {name}: ({pattern})", line), f"{path}: {line}"
        assert not lines[len(HEAD)].startswith("#"), path
        assert not re.search(r"[*|`]", "".join(lines[len(HEAD) :])), path


def test_no_csv_mixes_states_of_the_rules(root):
    for path in (root / tables.MEASURED).glob("*.csv"):
        table = pd.read_csv(path, comment="#")
        assert "rules" not in table or table["rules"].nunique() == 1, path


@pytest.mark.parametrize(
    ("template", "cell"),
    [
        ("{a}", "1.50"),
        ("{a:.1f} dB", "1.5 dB"),
        ("{a_db:difference .2f}", "**+0.40** [+0.10, +0.70]"),
        ("{b_db:difference .2f}", "-0.40 [-0.90, +0.10]"),
        ("{c_db:difference .1f}", "**-0.4** [-0.9, -0.1]"),
        ("{a_db:interval .1f}", "0.4 [0.1, 0.7]"),
        ("{a_db:range ,.2f}", "0.40 (0.10 to 0.70)"),
        ("{many_s:range ,.0f}", "1,234"),
        ("{many_s:duration}", "20 min 34 s"),
        ("{a:duration}", "1.5 s"),
        ("{code:link}", "[flow/align.py](../../flow/align.py)"),
        ("{csv:link}", "[docs/measured/a.csv](../measured/a.csv)"),
        ("{none:link}", ""),
        ("{none} dB", ""),
        (["{a} dB", "{none} s"], "1.50 dB"),
        (["{a} dB", "{many_s} s"], "1.50 dB, 1234 s"),
    ],
)
def test_how_a_cell_is_written(template, cell):
    row = {"a": "1.50", "none": "", "many_s": "1234"}
    row |= {"code": "flow/align.py", "csv": "docs/measured/a.csv"}
    row |= {"a_db": "0.4", "a_low_db": "0.1", "a_high_db": "0.7"}
    row |= {"b_db": "-0.4", "b_low_db": "-0.9", "b_high_db": "0.1"}
    row |= {"c_db": "-0.4", "c_low_db": "-0.9", "c_high_db": "-0.1"}
    assert tables.cell(template, row) == cell


def test_a_column_that_is_not_there_is_named(root, tmp_path):
    path = tmp_path / "some.csv"
    path.write_text("# commit: 0\na\n1\n")
    with pytest.raises(ValueError, match=r"some\.csv: .*absent"):
        tables.table(path, {"heading": "{absent}"})


def test_a_table_shows_the_rows_that_are_asked_for(tmp_path):
    path = tmp_path / "some.csv"
    path.write_text("a,b\n1,x\n2,y\n3,x\n")
    shown = tables.table(path, {"a": "{a}"}, where={"b": ["x"], "a": [2, 3]})
    assert shown.splitlines()[2:] == ["| 3 |"]
    with pytest.raises(ValueError, match=r"some\.csv: no b z"):
        tables.table(path, {"a": "{a}"}, where={"b": ["z"]})


def test_readme_is_short_and_lines_are_narrow(root, pages):
    assert len((root / "README.md").read_text().splitlines()) <= README_LINES
    for path, text in pages.items():
        for number, line in enumerate(text.splitlines(), 1):
            wide = len(line) > LINE_WIDTH and not line.startswith("|")
            assert not wide, f"{path}:{number}"
        assert "@@" not in text, path


def test_pages_of_users_are_few_words_without_history(root):
    paths = [path for of in OF_USERS for path in sorted((root / "docs").glob(of))]
    assert len(paths) >= 15
    texts = {path: path.read_text() for path in paths}
    assert sum(len(text.split()) for text in texts.values()) <= WORDS
    for path, text in texts.items():
        assert not re.search(r"trainer before|\bcommit\b|other jobs", text), path


def test_a_howto_is_one_screen_and_begins_with_its_commands(root):
    paths = sorted((root / "docs/howto").glob("*.md"))
    assert len(paths) == 10
    for path in paths:
        lines = path.read_text().splitlines()
        assert len(lines) <= HOWTO_LINES, path
        assert any(line.startswith("    ") for line in lines[:8]), path


def sentences(path):
    """Strings of a module that are no names; of docstrings a command's help alone."""
    tree = ast.parse(path.read_text())
    bare = [one.value for one in ast.walk(tree) if isinstance(one, ast.Expr)]
    bare = bare[1:] if path.parent.name == "cli" else bare
    for node in set(ast.walk(tree)) - set(bare):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from [node.value] * (" " in node.value)


def test_what_a_user_reads_has_one_spelling(root, pages):
    texts = {path: CODE.sub("", text) for path, text in pages.items()}
    others = [root / "Snakefile", root / "Makefile", *root.glob("workflow/**/*.rst")]
    others += root.glob("workflow/schemas/*.yaml")
    texts |= {path: path.read_text() for path in others}
    for package in ("alignerf", "flow"):
        for path in (root / package).rglob("*.py"):
            texts[path] = "\n".join(sentences(path))
    found = {path.name: BRITISH.findall(text) for path, text in texts.items()}
    assert not {name: words for name, words in found.items() if words}


def test_every_page_stands_in_the_index_and_in_the_site(root):
    docs = root / "docs"
    found = {path.relative_to(docs).as_posix() for path in docs.rglob("*.md")}
    linked = {link for link in LINK.findall((docs / "README.md").read_text())}
    assert {"README.md", *linked} == found
    nav = yaml.safe_load((root / "mkdocs.yml").read_text())["nav"]
    assert sorted(leaves(nav)) == sorted(found)


def leaves(nav):
    """The pages of a site's contents."""
    if isinstance(nav, str):
        return [nav]
    parts = nav.values() if isinstance(nav, dict) else nav
    return [leaf for part in parts for leaf in leaves(part)]


def test_pages_that_code_and_configs_name_exist(root):
    named = {}
    for folder in ("alignerf", "flow", "tests", "workflow"):
        for path in (root / folder).rglob("*"):
            if path.suffix in (".py", ".yaml", ".smk"):
                for page in re.findall(r"\bdocs/[\w/]+\.md\b", path.read_text()):
                    named[page] = path
    assert len(named) >= 6
    missing = [
        f"{of}: {page}" for page, of in named.items() if not (root / page).exists()
    ]
    assert not missing, "\n".join(missing)


def test_a_cause_leads_to_a_page(root):
    for cause in causes.every():
        name, _, anchor = cause.page.partition("#")
        assert anchor in anchors((root / "docs" / name).read_text()), cause.name


def test_links_and_anchors_resolve(pages):
    count = 0
    for path, text in pages.items():
        for link in LINK.findall(text):
            if re.match(r"[a-z]+:", link):
                continue
            name, _, anchor = link.partition("#")
            target = (path.parent / name).resolve() if name else path
            assert target.exists(), f"{path}: {link}"
            if anchor:
                assert anchor in anchors(target.read_text()), f"{path}: {link}"
            count += 1
    assert count >= 20


def test_paths_exist(root, pages):
    pattern = r"`((?:alignerf|flow|workflow|profiles|docs|tests)/[\w./-]+)`"
    named = {
        (page, path) for page in pages for path in re.findall(pattern, pages[page])
    }
    missing = [f"{page}: {path}" for page, path in named if not (root / path).exists()]
    assert len(named) >= 30
    assert not missing, "\n".join(sorted(missing))


def test_make_targets_exist(root, pages):
    targets = re.findall(r"^# make (\w+)", (root / "Makefile").read_text(), re.M)
    readme = re.findall(r"^    make (\w+)", pages[root / "README.md"], re.MULTILINE)
    assert {"run", "test"} <= set(readme)
    everywhere = "\n".join(pages.values())
    named = re.findall(r"^    make (\w+)|`make (\w+)", everywhere, re.MULTILINE)
    assert {a or b for a, b in named} <= set(targets)


def test_modules_to_run_exist(root, pages):
    named = set(re.findall(r"python -m ([\w.]+\w)", "\n".join(pages.values())))
    assert {"alignerf.show", "tools.convert_weights", "tools.docs.tables"} <= named
    for module in named:
        path = root.joinpath(*module.split("."))
        found = path.with_suffix(".py").is_file() or (path / "__main__.py").is_file()
        assert found, module


def anchors(text):
    """The anchors that a Markdown page's headings get."""
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {
        re.sub(r"[^\w\- ]", "", h).strip().lower().replace(" ", "-") for h in headings
    }
