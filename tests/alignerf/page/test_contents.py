"""The tables, decisions, costs and links of the page."""

import json
import math

import numpy as np
import pandas as pd
import pytest

from alignerf.page import contents
from alignerf.tables import columns
from alignerf.tables.columns import Column


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


@pytest.mark.parametrize("table", ["views", "displacement"])
def test_the_page_says_why_a_part_can_be_longer_than_the_whole(table):
    note = columns.TABLES[table].note
    assert "part can be longer than the whole" in note
    assert "median of its own lengths" in note


def test_one_table_says_that_the_model_s_part_is_taken_off_and_not_in_the_other():
    note = columns.TABLES["displacement"].note
    assert "model's part is taken off" in note
    assert "table of every photo does not take it off" in note


def test_a_decision_that_the_config_leaves_open_is_taken(results):
    rows, taken = contents.decisions(results)
    assert taken
    assert [row["taken"] for row in rows] == [True]
    (results / "config.yaml").write_text(
        "models: {base: {near: 0.4}}\ntraining: {steps: 9, budget_min: null}\n"
    )
    rows, taken = contents.decisions(results)
    assert not taken
    assert [row["taken"] for row in rows] == [False]


def test_costs_are_told_where_a_preflight_was_asked_for(results):
    assert contents.costs(results) == []
    (results / "preflight.json").write_text(json.dumps({"said": "a: about 9 min"}))
    (line,) = contents.costs(results)
    assert line == "Expected before the first training: a: about 9 min."
