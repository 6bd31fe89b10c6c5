"""What pages quote is what was measured, and what the program does."""

import re

import pandas as pd
import pytest

from alignerf.causes import camera, motion, shift, training
from alignerf.page import photos, told

# An answer to how long the demo takes, as README gives it.
COST = re.compile(r"\d+ to\s+\d+\s+min")
BOTH = "poses wrong, objects move"
AUTO = "auto: corrected by flow, then optimized"


@pytest.fixture
def page_of(root):
    """name -> the text of a page, each break of a line a blank."""
    return lambda name: " ".join((root / name).read_text().split())


@pytest.fixture
def measured(root):
    """(name, column, rest: what a row is) -> the number in docs/measured/NAME.csv."""

    def read(name, column, **row):
        table = pd.read_csv(root / f"docs/measured/{name}.csv", comment="#")
        for key, value in row.items():
            table = table[table[key] == value]
        (value,) = table[column]
        return value

    return read


def test_gains_that_are_advised_with_are_those_measured(measured):
    way = {"scene": BOTH, "method": AUTO}
    moved = {"condition": "objects move", "remedy": "photos warped once, from scratch"}
    assert {
        "AUTO_DB": measured("in_loop", "equal_db", share=1, **way),
        "AUTO_TWICE_DB": measured("in_loop", "equal_db", share=2, **way),
        "LONGER_DB": measured("tradeoff", "difference_db", setting="4000 steps"),
        "WARPED_MOTION_DB": measured("remedies_steps", "gain_db", **moved),
        "WARPED_MOTION_TWICE_DB": measured("remedies", "gain_db", budget=2, **moved),
    } == {
        name: pytest.approx(number, abs=0.05)
        for module in (camera, motion, training)
        for name, number in vars(module).items()
        if name.endswith("_DB")
    }


def test_the_page_says_how_often_verdicts_were_right(root, page_of):
    table = pd.read_csv(root / "docs/measured/verdicts.csv", comment="#")
    table = table[table["read_as"] == "its renders"].set_index("capture")
    each = {row.Index: (row.first, row.first_of) for row in table.itertuples()}
    right, of = each.pop("all")
    assert each == told.RIGHT
    assert f"{told.FALSE_EACH:.2f}" == f"{table.loc['all', 'false_each']:.2f}"
    readme = page_of("README.md")
    for said in (f"first in {right} of {of}", f"{told.FALSE_EACH:.2f} causes"):
        assert said in readme
    for name, (right, of) in told.RIGHT.items():
        assert f"{name} {right} of {of}" in readme


def test_pages_quote_the_same_gains(page_of, measured):
    brought = r"it brought ([\d.]+) dB in the seconds of one training, ([\d.]+) dB in"
    found = re.findall(brought, page_of("docs/evidence/verdict.md"))
    way = {"scene": BOTH, "method": AUTO}
    wanted = [measured("in_loop", "equal_db", share=n, **way) for n in (1, 2)]
    assert found == [tuple(f"{db:.1f}" for db in wanted)]


def test_the_verdict_that_is_quoted_is_that_of_the_picture(root):
    headline, *_ = (root / "docs/pictures/page.txt").read_text().splitlines()
    printed = (root / "docs/outputs/verdict.txt").read_text()
    assert headline.lower() in " ".join(printed.split()).lower()


def test_the_picture_of_the_page_is_of_the_run_in_the_tables(root, page_of):
    """A picture of an older run shows other gains, or lacks some."""
    table = pd.read_csv(root / "docs/measured/misalignment.csv", comment="#")
    ends = ("difference_db", "difference_low_db", "difference_high_db")
    wanted = {}
    for row in table.dropna(subset=ends[0]).itertuples():
        method, _, _ = row.method.partition(" (")
        warped = "" if row.warping == "none" else f", warped {row.warping}"
        wanted[method + warped] = [f"{getattr(row, end):+.2f}" for end in ends]
    headline, *lines = (root / "docs/pictures/page.txt").read_text().splitlines()
    said = re.compile(r"(.+): (\S+) dB \[(\S+), (\S+)\]")
    found = {m[1]: list(m.groups()[1:]) for line in lines if (m := said.match(line))}
    assert found == wanted
    assert f'its upper part: "{headline}"' in page_of("docs/start.md")


def test_pages_say_the_scale_of_the_flow_and_that_figures_have_their_own(page_of):
    text = page_of("docs/reference/files.md")
    assert f"full colour is {photos.FULL_PX:g} px" in text
    assert "rim of their colour wheel" in text
    assert f"{shift.ALIGNED_PX:g} px, or what the estimator finds" in text


def test_the_page_on_the_method_reads_the_verdict_as_it_is(page_of):
    text = page_of("docs/evidence/alignerf.md")
    assert f"From {shift.ALIGNED_PX:g} px on it calls photos misaligned" in text
    assert "*training* views (`flow_train_px` in `verdict.json`)" in text
    assert "train longer first" not in text


@pytest.mark.parametrize(
    ("name", "before"),
    [
        ("README.md", "make run #"),
        ("docs/evidence/demo.md", "Cost: "),
        ("docs/start.md", "the demo: "),
        ("workflow/config/demo.yaml", "Cost: "),
    ],
)
def test_the_demo_takes_as_long_wherever_that_is_said(page_of, name, before):
    text = page_of(name)
    start = text.index(before)
    found = COST.search(text[start : start + 120])
    assert found, name
    assert found[0].startswith("5 to 8 min")
