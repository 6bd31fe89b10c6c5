"""The registry of columns: tables have those that it says, and each has a meaning."""

import pytest

from alignerf import align_test_poses, evaluate, tabulate
from alignerf.tables import columns, controls, latex
from alignerf.tables.across import comparison
from alignerf.verdict import views
from flow import decompose
from flow.estimation import folders
from flow.warping import controls as control_flows
from tests import table_cases
from tests.table_cases import made

SETS = (*sorted(controls.needed()), "oracle", "oracle_still", "oracle_moving")
ROWS = [
    table_cases.row(dict.fromkeys(SETS, db), name)
    for db, name in (
        ({"psnr_db": [20.0, 22.0]} | dict.fromkeys(columns.PARTS, 1.0), "one"),
        ({"psnr_db": [21.0, 25.0]} | dict.fromkeys(columns.PARTS, 2.0), "two"),
    )
]


@pytest.mark.parametrize("name", tabulate.TABLES)
def test_a_table_has_the_columns_of_the_registry(name):
    table = made(tabulate.TABLES[name].make, [table_cases.scored("a", ROWS)])
    assert list(table.columns) == columns.names(name)
    assert len(table)


def test_so_has_a_ranking_across_scenes():
    table = made(comparison.make_ranking, [table_cases.scored("a", ROWS)])
    assert list(table.columns) == columns.names("comparison_ranking")


def test_what_is_said_of_each_photo_has_them_too():
    """In another order: the page's is that of the registry."""
    assert sorted(views.COLUMNS) == sorted(columns.names("views"))


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("metrics", evaluate.COLUMNS),
        ("lengths", folders.COLUMNS),
        ("decomposition", decompose.COLUMNS),
        ("aligned_pose", align_test_poses.COLUMNS),
        ("overfit", control_flows.COLUMNS),
    ],
)
def test_so_have_the_files_of_a_round(name, written):
    assert list(written) == columns.names(name)


@pytest.mark.parametrize("name", [n for n, t in columns.TABLES.items() if t.latex])
def test_a_heading_in_latex_stands_once_and_over_a_column(name):
    """Of two equal ones the second would take the first one's cells."""
    table, spec = columns.TABLES[name], columns.TABLES[name].latex
    headings = [
        *spec["rows"].values(),
        *(head for head, _ in spec.get("cells", {}).values()),
    ]
    assert len({*headings}) == len(headings)
    assert {*spec["rows"], *spec.get("cells", {})} <= {*table.columns}
    assert spec.keys() <= {"rows", "cells", "notes"}


@pytest.mark.parametrize("name", columns.TABLES)
def test_every_column_has_a_meaning_or_shares_the_one_before(name):
    table = columns.TABLES[name]
    first, *_ = table.columns.values()
    assert first.what
    for column in table.columns.values():
        assert not column.form or column.heading
        assert column.what == column.what.strip()


def test_the_page_shows_no_table_without_a_title():
    titled = {name for name, table in columns.TABLES.items() if table.title}
    assert titled == {"views", "misalignment", "displacement"}
    for name in titled:
        assert columns.TABLES[name].note
        assert any(column.heading for column in columns.TABLES[name].columns.values())


def test_metrics_have_their_headings_in_latex():
    assert latex.metric("psnr_db")[1] == r"PSNR (dB) $\uparrow$"
    assert latex.metric("lpips_vgg")[1] == r"LPIPS (VGG) $\downarrow$"
    assert latex.metric(columns.PRINTED_ONLY)[1] == r"LPIPS (published) $\downarrow$"
