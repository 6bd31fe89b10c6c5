"""The reference names nothing that the program does not have."""

import argparse
import contextlib
import functools
import importlib
import re
from unittest import mock

import pytest
import yaml

from alignerf import config, methods, testsets
from alignerf.cli import why_blurry

REFERENCE = "docs/reference"
# A name in the first column of a table of keys.
KEY = re.compile(r"^\| (`[^|]+`) \|", re.MULTILINE)
# A name of several words, as keys, columns and settings have: `psnr_db`.
NAME = re.compile(r"`([a-z]+(?:_[a-z0-9]+)+)`")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
# Files and names of other programs.
OTHERS = {"renders": {"ply_file_path", "applied_transform"}}
OTHERS |= {"captures": {"mask_path", "corrected_images", "corrected_cameras"}}


@pytest.fixture(scope="module")
def schema():
    return yaml.safe_load(config.schema_text())


@pytest.fixture(scope="module")
def page_of(root):
    return lambda name: (root / REFERENCE / f"{name}.md").read_text()


def parts_of(own, schema):
    """A key's schema, and all that it may be, without references."""
    for one in own.get("anyOf", [own]):
        name = one.get("$ref", "").rpartition("/")[2]
        yield schema["$defs"][name] if name else one


def entries_of(own, word, schema):
    """What a key is below another one, or any name of a mapping's."""
    for part in parts_of(own, schema):
        named = part.get("patternProperties", {}).values()
        yield from named if word == "NAME" else ()
        if word in part.get("properties", {}):
            yield part["properties"][word]


def test_keys_of_the_page_are_in_the_schema(page_of, schema):
    cells = [cell for cell in KEY.findall(page_of("keys")) if cell != "`key`"]
    named = [name for cell in cells for name in re.findall(r"`([^`]+)`", cell)]
    assert len(named) >= 30
    for name in named:
        found = [schema]
        for word in name.split("."):
            found = [one for own in found for one in entries_of(own, word, schema)]
        assert found, name


def test_every_key_has_a_meaning_and_a_default(schema):
    """A section's defaults are those of its keys; a change has none."""
    for of in ({"properties": schema["properties"]}, *schema["$defs"].values()):
        needed = {*of.get("required", ()), "scenes"}
        changes = of is schema["$defs"]["Changes"]
        for name, own in of["properties"].items():
            assert own.get("description", "").strip(), name
            section = any("properties" in one for one in parts_of(own, schema))
            assert "default" in own or name in needed or section or changes, name


def test_every_method_is_on_the_page_of_keys(page_of):
    text = page_of("keys")
    for record in methods.every():
        own = type(record).__module__.startswith("alignerf.")
        assert not (own and record.key) or f"`methods.NAME.{record.key}`" in text


@pytest.fixture(scope="module")
def words(root):
    """All words of the program's own text."""
    found = set()
    for folder in ("alignerf", "flow", "workflow"):
        for path in (root / folder).rglob("*"):
            if path.suffix in (".py", ".yaml", ".smk"):
                found |= set(re.findall(r"\w+", path.read_text()))
    return found


def test_names_of_the_reference_are_the_programs(root, words):
    count = 0
    for path in sorted((root / REFERENCE).glob("*.md")):
        named = set(NAME.findall(path.read_text())) - OTHERS.get(path.stem, set())
        assert named <= words, (path.name, sorted(named - words))
        count += len(named)
    assert count >= 40


def test_every_test_set_is_on_the_page_of_files(page_of):
    text = page_of("files")
    assert all(f"| `{one.name}` |" in text for one in testsets.every())


@functools.cache
def options_of(module):
    """The options of a command, by its parser; nothing is run. {option: its help}."""
    made = []

    def stop(parser, *_, **__):
        made.append(parser)
        raise SystemExit

    main = importlib.import_module(module).main
    patched = mock.patch.object(argparse.ArgumentParser, "parse_args", stop)
    with patched, contextlib.suppress(SystemExit):
        main([])
    return {
        name: one.help
        for parser in made
        for one in parser._actions
        for name in one.option_strings or [one.dest]
    }


COMMANDS = {name: of for name, of in why_blurry.COMMANDS.items() if name != "show"}


@pytest.mark.parametrize("module", COMMANDS.values())
def test_every_option_says_what_it_means(module):
    options = options_of(module)
    assert options
    assert all(options.values()), options


def test_options_of_the_page_are_the_commands(page_of):
    text = page_of("commands")
    table = text.partition("| option | of |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| (`--[^|]+) \| ([^|]+) \|", table, re.MULTILINE)
    assert len(rows) >= 8
    for cell, of in rows:
        for command in of.split(", "):
            assert set(OPTION.findall(cell)) <= options_of(COMMANDS[command]).keys()
    typed = re.findall(r"why-blurry (\w+)([^`|]*)", text)
    for command, rest in typed:
        assert command in why_blurry.COMMANDS
        if command in COMMANDS:
            assert set(OPTION.findall(rest)) <= options_of(COMMANDS[command]).keys()


def test_targets_of_the_page_are_rules_or_scenes(root, page_of):
    text = page_of("commands").partition("| target |")[2].partition("\n\n")[0]
    named = re.findall(r"^\| .*?`(\w+)`.*? \|", text, re.MULTILINE)
    assert {"preview", "comparison", "courtyard"} <= set(named)
    paths = [root / "Snakefile", *(root / "workflow/rules").glob("*.smk")]
    code = "\n".join(path.read_text() for path in paths)
    demo = yaml.safe_load((root / "workflow/config/demo.yaml").read_text())
    known = set(re.findall(r"^\s*rule (\w+):", code, re.MULTILINE)) | {*demo["scenes"]}
    tables = (root / "alignerf/experiment").rglob("*.py")
    known |= set(re.findall(r"\w+", "\n".join(path.read_text() for path in tables)))
    assert set(named) <= known
