"""Lists of the reference are what the program itself says."""

import sys
import types

import pytest

from tools.docs import lists


@pytest.mark.parametrize(
    ("own", "values", "default"),
    [
        ({"type": "boolean", "default": False}, "true, false", "`false`"),
        ({"type": "integer", "minimum": 1, "maximum": 9}, "whole number, 1 to 9", ""),
        ({"type": "number", "exclusiveMinimum": 0}, "number, from above 0", ""),
        ({"type": "number", "default": 1e-15}, "number", "`1.0e-15`"),
        ({"enum": ["a", "b"], "type": "string"}, "`a`, `b`", ""),
        ({"$ref": "#/$defs/NerfSystem"}, "[NerfSystem](#nerfsystem)", ""),
        (
            {"anyOf": [{"type": "string"}, {"type": "null"}], "default": None},
            "text or null",
            "`null`",
        ),
        (
            {"type": "array", "items": {"type": "integer"}, "default": [32, 16]},
            "list of whole number",
            "`[32, 16]`",
        ),
        (
            {"type": "object", "patternProperties": {"a": {"type": "string"}}},
            "name: text",
            "",
        ),
    ],
)
def test_what_a_key_may_be(own, values, default):
    assert (lists.values(own), lists.default(own)) == (values, default)


def test_keys_are_those_of_the_schema():
    table = lists.keys("Align")
    assert "| `shrink` | whole number, 1 to 16 | `3` |" in table
    assert "Align" in lists.classes()
    with pytest.raises(ValueError, match="no class Other"):
        lists.keys("Other")


def test_options_are_those_of_the_parser(monkeypatch):
    module = types.ModuleType("some_tool")

    def main(argv=None):
        import argparse

        parser = argparse.ArgumentParser()
        parser.add_argument("folder", help="of photos")
        parser.add_argument("--name", help="of a|b")
        parser.add_argument("--colour", choices=["black", "white"])
        parser.add_argument("--dry", action="store_true")
        parser.parse_args(argv)
        raise AssertionError("it was run")

    module.main = main
    monkeypatch.setitem(sys.modules, "some_tool", module)
    assert lists.options("some_tool").splitlines()[2:] == [
        "| `folder` | of photos |",
        r"| `--name NAME` | of a\|b |",
        "| `--colour COLOUR` | one of black, white |",
        "| `--dry` |  |",
    ]


def test_commands_are_those_of_the_heads(tmp_path):
    path = tmp_path / "Makefile"
    path.write_text("# make run    the demo\n# more words\n#\n\n# make not\nrun:\n")
    assert lists.make(path).splitlines()[2:] == ["| `make run` | the demo |"]
    path.write_text("# S\n#   snakemake --cores N a    one\n#   snakemake -n  two\n")
    assert lists.targets(path).splitlines()[2:] == ["| `snakemake --cores N a` | one |"]
