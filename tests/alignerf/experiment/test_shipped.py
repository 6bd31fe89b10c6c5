"""The shipped configs: what they call by the paper's names, and the models' sizes."""

import csv

import jax
import pytest

from alignerf.experiment.tables import rows, shipped
from alignerf.training import compose

SIZES = pytest.mark.parametrize("small", [True, False], ids=["small", "full"])


@pytest.fixture
def shipped_in(photos_of_tables):
    def make(small):
        given = shipped.configs({"small": small})
        return shipped.experiments(given, (), [shipped.PAPER]).by_name

    return make


def printed():
    with open(rows.published_table(), newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def methods_of(by_name):
    return [m for table in shipped.TABLES for m in by_name[table].methods.values()]


@SIZES
def test_what_the_paper_prints_has_rows_of_ours(shipped_in, small):
    by_name = shipped_in(small)
    assert {*shipped.TABLES, "figures"} <= by_name.keys()
    assert ("" in by_name) == ("tradeoff" in by_name) == small
    for number, table in enumerate(shipped.TABLES, start=1):
        experiment = by_name[table]
        assert experiment.config.published_table == number
        called = {one.published for one in experiment.methods.values()}
        names = [row["method"] for row in printed() if row["table"] == str(number)]
        assert called - {None} <= {*names}
    # Rows that are another program's alone.
    left = {"Deep Blending", "Point-Based Neural Rendering", "Stable View Synthesis"}
    every = {one.published for one in methods_of(by_name)}
    if not small:
        assert {row["method"] for row in printed()} - every == left


@SIZES
def test_the_models_of_table_1_are_as_far_apart_as_the_papers(shipped_in, small):
    """Its have 139.2 and 9.9 million parameters."""
    experiment = shipped_in(small)["table1"]
    scene = next(iter(experiment.scenes))

    def params(method):
        made = compose.make_method(experiment.at(scene, method, 0).job)
        found = jax.eval_shape(made.init, jax.random.key(0))
        return sum(leaf.size for leaf in jax.tree.leaves(found))

    assert params("mipnerf360_large") / params("mipnerf360") >= 10


def test_a_config_that_cannot_run_stops_those_alone_that_ask_for_it(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("ALIGNERF_DATA", str(tmp_path))
    given = shipped.configs({})

    def of(*words):
        return shipped.experiments(given, (), words).by_name

    # In a job, which knows no words, too.
    for found in (
        of(),
        of("table1"),
        shipped.experiments(given, (), None).by_name,
    ):
        assert {"table1", "table4", "figures"} <= found.keys()
        assert not {"table2", "table3", "tradeoff"} & found.keys()
    for words in (["table3"], [shipped.PAPER]):
        with pytest.raises(
            ValueError, match=r"^config: scenes\.\w+\.path: .* does not"
        ):
            of(*words)


@pytest.mark.parametrize("small", ["false", "no", False, 0])
def test_the_size_is_read_as_a_config_has_it(small):
    assert list(shipped.configs({"small": small})) == [*shipped.TABLES, "figures"]
    with pytest.raises(ValueError, match="small: 'maybe' is neither true nor false"):
        shipped.configs({"small": "maybe"})
