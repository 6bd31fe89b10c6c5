"""What stands on the page, and what a hostile or a missing file does to it."""

import html.parser
import json
import math
import urllib.parse

import numpy as np
import pandas as pd
import pytest

from alignerf.files import images
from alignerf.page import __main__ as page
from alignerf.page import contents, decided
from alignerf.tables import columns
from alignerf.tables.columns import Column


class Parser(html.parser.HTMLParser):
    """Tags, links and the text of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.links, self.sources = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.tags.append((tag, attributes))
        if tag == "a":
            self.links.append(attributes["href"])
        if "src" in attributes:
            self.sources.append(attributes["src"])


def test_a_page_is_one_file_whose_links_lead_somewhere(render, results):
    found = Parser(render())
    ids = {attributes["id"] for _, attributes in found.tags if "id" in attributes}
    for link in found.links:
        if link.startswith("#"):
            assert link[1:] in ids
        else:
            assert (results / urllib.parse.unquote(link)).is_file(), link
    assert found.links
    # Nothing is fetched.
    assert all(source.startswith("data:") for source in found.sources)
    assert not [
        attrs
        for tag, attrs in found.tags
        if tag == "link" and attrs["href"] != "data:,"
    ]


def test_the_verdict_stands_first_and_says_what_to_do(render):
    text = render()
    assert text.index("<h2>Aligned.</h2>") < text.index('id="look"')
    assert "<strong>To do:</strong> Nothing." in text


def test_names_and_reasons_are_text_and_never_markup(render):
    text = render()
    assert "<script>alert(1)</script>" not in text
    assert "A &lt; B &amp; C." in text
    tags = [tag for tag, _ in Parser(text).tags]
    # Data, and the page's own scripts; names add none.
    assert tags.count("script") == 6
    assert tags.count("b") == 1


def test_images_are_those_of_each_view(render):
    text = render()
    data = text.split('id="images">')[1].split("</script>")[0]
    found = json.loads(data)
    # By flow; of the training views the one that stands out.
    options = [attrs["value"] for tag, attrs in Parser(text).tags if tag == "option"]
    assert options == ["train/05", "test/03", "test/01", "test/<b>&'02"]
    assert set(found) == set(options)
    test, train = found["test/03"], found["train/05"]
    assert set(test) == {
        *("photo", "render", "flow", "warped photo"),
        *("render after round 1", "flow after round 1"),
    }
    assert set(train) == {"photo", "render", "flow", "warped photo"}
    assert len(set(test.values())) == len(test)


def test_numbers_are_sorted_as_numbers_and_none_comes_last():
    data = pd.DataFrame({"params": [1000.0, np.nan, 9.0], "method": ["b", None, "a"]})
    told = {
        "params": Column(heading="parameters", form=",.0f"),
        "method": Column(heading="method"),
        "psnr_db": Column(heading="PSNR (dB)", form=".2f"),
    }
    table = contents.table_of(data, told)
    assert [row[0].text for row in table["rows"]] == ["1,000", "--", "9"]
    assert [row[0].order for row in table["rows"]] == [1000.0, -math.inf, 9.0]
    assert [row[1].text for row in table["rows"]] == ["b", "", "a"]
    assert [column["is_text"] for column in table["columns"]] == [False, True]


def test_a_column_without_any_number_is_left_out():
    data = pd.DataFrame({"view": ["a"], "flow_px": [np.nan]})
    told = {"view": Column(heading="view"), "split": Column(what="not shown")}
    told["flow_px"] = Column(heading="flow", form=".2f")
    table = contents.table_of(data.assign(split="test"), told)
    assert [column["text"] for column in table["columns"]] == ["view"]


def test_headings_are_those_of_the_registry(results):
    shown = {table["name"]: table for table in contents.tables(results)}
    assert list(shown) == ["views", "misalignment"]
    table = shown["misalignment"]
    assert table["heading"] == "Image quality by method and warping"
    texts = [column["text"] for column in table["columns"]]
    assert texts[:4] == ["method", "warped", "test set", "PSNR (dB)"]
    assert [cell.text for cell in table["rows"][1]][-2:] == ["1.5", "1,000"]
    assert "flow (px)" in [column["text"] for column in shown["views"]["columns"]]


def test_what_moves_by_itself_and_what_no_camera_explains_have_their_own_words():
    headings = [
        columns.TABLES[table].columns["moved_share"].heading
        for table in ("views", "displacement")
    ]
    assert headings == ["moves by itself (%)", "not explained by the camera (%)"]


@pytest.mark.parametrize("table", ["views", "displacement"])
def test_the_page_says_why_a_part_can_be_longer_than_the_whole(table):
    note = columns.TABLES[table].note
    assert "part can be longer than the whole" in note
    assert "median of its own lengths" in note


def test_one_table_says_that_the_model_s_part_is_taken_off_and_not_in_the_other():
    note = columns.TABLES["displacement"].note
    assert "model's part is taken off" in note
    assert "table of every photo does not take it off" in note


@pytest.mark.parametrize(("overfit_px", "limit"), [(None, "0.25"), (0.4885, "0.49")])
def test_the_legend_has_the_limit_of_the_verdict(render, results, overfit_px, limit):
    path = results / "verdict.json"
    told = json.loads(path.read_text())
    told["evidence"]["overfit_px"] = overfit_px
    path.write_text(json.dumps(told))
    text = " ".join(render().split())
    assert f"Under {limit} px colours fade" in text


def test_beside_the_curves_it_says_why_the_flow_hardly_falls(render, results):
    (results / "figures").mkdir()
    image = np.zeros((4, 4, 3), np.uint8)
    images.write(results / "figures/curves.png", image)
    text = render()
    after = text[text.index('alt="Misalignment and quality') :]
    assert "flow to them hardly falls" in after


def test_a_decision_that_the_config_leaves_open_is_taken(results):
    rows, taken = decided.decisions(results)
    assert taken
    assert [row["taken"] for row in rows] == [True]
    (results / "config.yaml").write_text(
        "models: {base: {decided: []}}\ntraining: {decided: []}\n"
    )
    rows, taken = decided.decisions(results)
    assert not taken
    assert [row["taken"] for row in rows] == [False]


def test_costs_are_told_where_a_preflight_was_asked_for(results):
    assert contents.costs(results) == []
    plan = {"wall_s": 7200, "cores": 2, "memory_bytes": 3e9, "disk_bytes": 5e8}
    (results / "preflight.json").write_text(json.dumps(plan))
    (line,) = contents.costs(results)
    assert "2.0 hours on 2 cores, 3.0 GB of memory, 0.50 GB of disk" in line
    (results / "preflight.json").write_text("{}")
    assert contents.costs(results) == []


@pytest.mark.parametrize("text", ["", "[]", "{", "\x00"])
def test_a_broken_file_is_named(results, text):
    (results / "verdict.json").write_text(text)
    with pytest.raises(ValueError, match=r"verdict\.json: not the JSON"):
        contents.verdict(results)


def test_a_missing_image_stops_it_by_name_and_leaves_the_old_page(results, capsys):
    (results / "index.html").write_text("old")
    (results / "base/round0/renders/test/01.png").unlink()
    rounds = [{"renders": str(results / "base/round0/renders/test")}]
    rounds[0]["flow"] = str(results / "base/round0/flow/test")
    arguments = ["--scene", str(results), "--base", str(results / "base/round0")]
    arguments += ["--rounds", json.dumps(rounds)]
    with pytest.raises((ValueError, OSError), match=r"01\.png"):
        page.main([*arguments, "--out", str(results / "index.html")])
    assert (results / "index.html").read_text() == "old"
    assert not list(results.glob(".index*"))


def test_where_no_photo_stands_out_the_page_is_made_all_the_same(render, results):
    path = results / "tables/views.csv"
    table = pd.read_csv(path, dtype={"view": str}).assign(stands_out=np.nan)
    table.to_csv(path, index=False)
    assert "held out: 3.00 px of the training size apart" in render()


def test_a_photo_may_be_called_na(render, results):
    for folder in results.rglob("*/test"):
        for kept in folder.glob("01.*"):
            kept.rename(kept.with_stem("NA"))
    (results / "images/01.png").rename(results / "images/NA.png")
    path = results / "tables/views.csv"
    path.write_text(path.read_text().replace("01,", "NA,", 1))
    assert "test/NA" in render()
