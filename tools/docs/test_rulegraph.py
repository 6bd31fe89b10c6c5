"""The picture of the rules has few arrows, and is that of the rules."""

from tools.docs import rulegraph

PRINTED = """flowchart TB
	id0[all]
	id1[poses]
	id2[train]
	id3[render]
	style id0 fill:#D96F57
	id1 --> id0
	id3 --> id0
	id1 --> id2
	id2 --> id2
	id3 --> id2
	id1 --> id3
	id2 --> id3
"""


def test_an_arrow_is_left_out_where_a_longer_way_leads_there():
    assert rulegraph.reduced(PRINTED).splitlines() == [
        "flowchart LR",
        "  poses --> train",
        "  render --> all",
        "  train --> render",
        "  render -. next round .-> train",
    ]


def test_the_page_shows_the_rules_as_they_are(root, tmp_path, dry_run):
    code, output = dry_run(tmp_path, *rulegraph.COMMAND[1:], "-n")
    assert code == 0
    shown = rulegraph.reduced(output)
    assert f"```mermaid\n{shown}\n```" in (root / "docs/develop/paper.md").read_text()
