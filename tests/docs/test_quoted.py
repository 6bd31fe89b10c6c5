"""What pages quote is what was measured, and what the program does."""

import re

import pandas as pd
import pytest

from alignerf.causes import camera, motion, training
from alignerf.causes.shared import misalignment
from alignerf.page import gallery, told
from alignerf.tables import effects
from tools.docs import tables

# An answer to how long the demo takes, as README gives it.
COST = re.compile(r"\d+\s+min")
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
    table = tables.verdicts(root)
    every = table.loc["all"]
    readme, page = page_of("README.md"), told.how_right()
    assert f"first in {every['first']} of {every.first_of}" in readme
    assert all(f"{every.false_each:.2f} causes" in text for text in (readme, page))
    assert f"first in {every['first']} of {every.first_of}" in page


def test_sizes_that_are_not_shown_give_the_verdict_of_the_smallest(root):
    table = pd.read_csv(root / "docs/measured/windows.csv", comment="#")
    others = {
        (capture, width)
        for (capture, _), own in table.groupby(["capture", "poses"])
        for width, verdict in zip(own["trained_px"], own["verdict"], strict=True)
        if verdict != own.sort_values("trained_px")["verdict"].iloc[0]
    }
    assert others == {("castle_P30", 512)}


def test_pairs_that_are_rejected_are_those_measured(root, page_of):
    table = pd.read_csv(root / "docs/measured/pairs.csv", comment="#")
    table = table.set_index("renders")
    rejected = table[table["named"] == table["pairs"]]["pairs"]
    other = rejected.pop("of another capture")
    kept = table[table["named"] == 0]["pairs"]
    assert len(rejected) + len(kept) + 1 == len(table) == 11
    (every,) = {*rejected} | {*kept.drop("trained")}
    text = page_of("docs/evidence/verdict.md")
    assert f"({every} each), or of another capture ({other})" in text
    assert (
        f"rejects none of {kept['trained']} trained renders, nor of {every} photos"
        in text
    )


def test_verdicts_on_splats_are_counted_as_measured(root, page_of):
    table = pd.read_csv(root / "docs/measured/splat_verdicts.csv", comment="#")
    text = page_of("docs/evidence/splats.md")
    right = table["right"] == "yes"
    assert f"nothing else, for {right.sum()} of {len(table)} splats" in text
    cells = re.findall(r"\| (\d) of (\d) (?=\|)", text)
    assert sum(int(one) for one, _ in cells) == right.sum()
    assert sum(int(of) for _, of in cells) == len(table)


def test_hours_of_the_paper_s_tables_are_those_computed(page_of, measured):
    text = page_of("docs/evidence/costs.md")
    for number in (2, 3):
        hours, dollars = (
            measured("clusters", column, table=number, system="all")
            for column in ("gpu_h", "usd")
        )
        said = f"Table {number}: {hours:,.0f} GPU hours, {dollars:,.0f} dollars"
        assert said in text


def test_pages_quote_the_same_gains(page_of, measured):
    brought = r"brought ([\d.]+) dB at the time of one training, ([\d.]+) dB at that"
    found = re.findall(brought, page_of("docs/evidence/verdict.md"))
    way = {"scene": BOTH, "method": AUTO}
    wanted = [measured("in_loop", "equal_db", share=n, **way) for n in (1, 2)]
    assert found == [tuple(f"{db:.1f}" for db in wanted)]


def test_the_verdict_that_is_quoted_is_of_the_run_in_the_tables(root):
    """The verdict of an older run shows other gains, or lacks some."""
    table = pd.read_csv(root / "docs/measured/misalignment.csv", comment="#")
    wanted = {}
    for row in table.dropna(subset="difference_db").itertuples():
        method = row.method
        warped = "" if row.warping == "none" else f", warped {row.warping}"
        ends = (row.difference_db, row.difference_low_db, row.difference_high_db)
        wanted[method + warped] = pytest.approx(ends, abs=0.051)
    text = " ".join((root / "docs/outputs/verdict.txt").read_text().split())
    said = r"([\w, ]+): (\S+) dB \[(\S+), (\S+)\]"
    tried = text[text.index("TRIED ") + 6 : text.index(" MEASURED ")]
    # Where the interval is wide, gains have one decimal.
    called = {"corrected cameras": "adjusted_cameras"}
    called |= {"large model": "mipnerf360_large", "small model": "mipnerf360"}
    found = {}
    for name, *ends in re.findall(said, tried):
        own, comma, warped = name.strip().partition(", ")
        found[called.get(own, own) + comma + warped] = tuple(map(float, ends))
    assert found == wanted


def test_pages_say_the_scale_of_the_flow_and_that_figures_have_their_own(page_of):
    text = page_of("docs/reference/files.md")
    assert f"full color is {gallery.FULL_PX:g} px" in text
    assert "rim of its color wheel" in text
    assert f"{misalignment.ALIGNED_PX:g} px, or what the estimator finds" in text


def test_fixes_on_real_captures_are_those_measured(root, page_of, measured):
    """The page's first table has figures of other CSVs, side by side."""
    table = pd.read_csv(root / "docs/measured/fixes.csv", comment="#")
    names = {"adjusted": "cameras adjusted before", "right": "true poses"}
    names |= {"auto": AUTO, "aligned": "aligned in the loop"}
    names |= {"optimized": "poses optimized with the scene"}
    scenes = ["castle, off by 1.5 px", "fox, off by 1.5 px"]
    scenes += ["chair, three crops, the phone's poses"]
    scenes += ["chair, the same crops, adjusted poses", "flower, 504x378"]
    compared = 0
    for scene, row in zip(scenes, table.to_dict("records"), strict=True):
        for name, method in names.items():
            for end in ("", "low_", "high_"):
                if not pd.isna(value := row[f"{name}_{end}db"]):
                    way = {"scene": scene, "method": method}
                    assert value == measured("in_loop_real", f"gain_{end}db", **way)
                    compared += 1
    assert compared == 3 * (5 + 5 + 3 + 3 + 3)
    crops = [scenes[2], scenes[3], "chair, the same crops, COLMAP's poses"]
    phone, adjusted, colmap = (
        measured("in_loop_real", "psnr_db", scene=scene, method="plain training")
        for scene in crops
    )
    (chair,) = table.dropna(subset="adjusted_mean_db").to_dict("records")
    assert chair["adjusted_mean_db"] == pytest.approx(adjusted - phone, abs=0.005)
    assert chair["right_mean_db"] == pytest.approx(colmap - phone, abs=0.005)
    text = page_of("docs/evidence/fixes.md")
    assert "adjusted cameras bring 1.0 to 1.7 dB on three real captures" in text
    assert "`auto` brings 0.4 to 1.6 dB, optimized poses 0.3 to 1.5" in text


def test_splats_gain_as_the_page_on_fixes_says(root, page_of):
    table = pd.read_csv(root / "docs/measured/splats_first.csv", comment="#")
    rise = [f"{gain:.1f}" for gain in table["adjusted_db"] - table["came_db"]]
    own = [f"{gain:.1f}" for gain in table["trainer_db"] - table["came_db"]]
    said = f"adjusted cameras bring {rise[0]} dB (fox off by 3 px), {rise[1]} (chair,"
    text = page_of("docs/evidence/fixes.md")
    assert f"{said} phone) and {rise[2]} (castle" in text
    assert f"own optimizer {own[0]}, {own[1]} and {own[2]}" in text


def test_the_papers_table_3_is_the_published_one(root):
    published = pd.read_csv(root / "results/published/tables.csv")
    published = published[published["table"] == 3].set_index("method")["psnr_db"]
    path = root / "docs/measured/table3_ten_minutes.csv"
    table = pd.read_csv(path, comment="#").dropna(subset="paper_db")
    for row in table.itertuples():
        gain_db = published[row.system.split(",")[0]] - published["mip-NeRF 360"]
        assert row.paper_db == pytest.approx(gain_db, abs=0.001)
    assert len(table) == 5


def test_the_page_on_reproduction_quotes_its_tables(root, page_of, measured):
    text = page_of("docs/evidence/reproduction.md")
    said = "{:+.2f} dB after 2000 steps, {:+.2f} after 8000"
    for method in ("aligned loss", "AligNeRF as printed"):
        gains = [
            measured("budget", "steps_db", method=method, steps=steps)
            for steps in (2000, 8000)
        ]
        assert said.format(*gains) in text
    for number in (1, 4):
        path = root / f"docs/measured/table{number}_effects.csv"
        for row in pd.read_csv(path, comment="#").to_dict("records"):
            known = {key: value for key, value in row.items() if pd.notna(value)}
            assert effects.word(known) == row["reproduced"], row["effect"]


def test_the_papers_statements_are_counted_as_listed(root, page_of):
    path = root / "docs/measured/statements.csv"
    table = pd.read_csv(path, comment="#", keep_default_na=False)
    assert [*table["number"]] == [*range(1, 98)]
    for row in table.itertuples():
        assert len(row.statement.split()) <= 8, row
        assert not row.place or (root / row.place).is_file(), row
    text = page_of("docs/evidence/reproduction.md").rpartition("## The paper's")[2]
    said = re.compile(
        r"the paper's (?P<all>\d+) statements (?P<yes>\d+) hold here \(\*yes\*: .*\) "
        r"and (?P<partly>\d+) \*partly\*; (?P<no>\d+) do not \(\*no\*\), "
        r"of (?P<opposite>\d+) the \*opposite\* is shown, "
        r"and (?P<not_run>\d+) are \*not run\*"
    )
    counts = {name: int(count) for name, count in said.search(text).groupdict().items()}
    assert counts.pop("all") == len(table)
    counts["not run"] = counts.pop("not_run")
    assert table["state"].value_counts().to_dict() == counts


@pytest.mark.parametrize(
    ("name", "before"),
    [
        ("README.md", "make run "),
        ("docs/start.md", "the demo: "),
        ("workflow/config/demo.yaml", "Cost: "),
    ],
)
def test_the_demo_takes_as_long_wherever_that_is_said(page_of, name, before):
    text = page_of(name)
    start = text.index(before)
    found = COST.search(text[start : start + 120])
    assert found, name
    assert found[0].startswith("8 min")
