"""Rows as papers print them stand below ours, and compare with nothing."""

import types

import pandas as pd
import pytest

from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import misalignment
from tests import table_cases
from tests.table_cases import made

PRINTED = """source,method,scene,psnr_db,ssim,lpips_published
arXiv 1,mip-NeRF 360,garden,99,0.813,0.17
arXiv 1,mip-NeRF 360,mean,24.47,0.691,0.283
arXiv 2,mip_NeRF,garden,26,0.8,0.2
"""


@pytest.fixture
def path(tmp_path):
    """A table as papers print it."""
    path = tmp_path / "means.csv"
    path.write_text(PRINTED)
    return path


def printed(path, scene):
    """Lines of a table that are printed for a scene."""
    args = types.SimpleNamespace(published=[path], called=scene)
    return list(misalignment.printed(args))


def make(path, scene):
    """The table of one row and of what is printed for a scene."""
    row = table_cases.row({"standard": [20.0, 22.0], "warped": [21.0, 23.0]})
    return made(misalignment.make_table, [row], printed(path, scene))


def test_published_rows_stand_below_and_compare_with_nothing(path):
    table, alone = make(path, "garden"), make(path, "fox")
    pd.testing.assert_frame_equal(table[:2], alone, check_dtype=False)
    rows = table[2:].set_index("method")
    assert list(rows.index) == ["mip-NeRF 360, published", "mip_NeRF, published"]
    assert list(rows["source"]) == ["arXiv 1", "arXiv 2"]
    assert list(rows["test_set"]) == ["standard"] * 2
    assert list(rows["psnr_db"]) == [99, 26]
    assert list(rows["lpips_published"]) == [0.17, 0.2]
    empty = [*misalignment.COUNTS, "total_time_s", "lpips_alex", "difference_db"]
    assert rows[empty].isna().all(axis=None)
    tex = misalignment.to_latex(table)
    body = tex.split(r"\bottomrule")[0].split(r"\midrule")[1].splitlines()
    above, below = "".join(body[:2]), "".join(body[2:])
    # The 99 dB are not the best: they are nobody's of these.
    assert r"\cellcolor[HTML]{FF9999}" in above
    assert "cellcolor" not in below
    for text in ("99.00", r"mip\_NeRF, published", "0.170"):
        assert text in below
    assert "% mip-NeRF 360, published: as printed, arXiv 1." in tex
    assert "LPIPS (published)" in tex
    assert "nan" not in tex.lower()
    # Of other scenes nothing is printed.
    tex = misalignment.to_latex(alone)
    assert "published" not in tex
    assert tex.count(r"\midrule") == 1


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("mip_NeRF", "mip-NeRF 360", "scene garden: a method stands twice"),
        ("ssim", "SSIM", ".*: no column ssim"),
    ],
)
def test_a_published_table_that_is_none_is_named(path, old, new, reason):
    path.write_text(PRINTED.replace(old, new))
    with pytest.raises(ValueError, match=rf"means\.csv: {reason}"):
        make(path, "garden")


def test_scenes_of_the_papers_are_known_by_their_names(root):
    for scene in ("bicycle", "flowers", "garden", "stump", "treehill"):
        path, *_ = table_rows.published(scene)
        assert path == str(root / "results/published/scenes.csv")
        (line,) = printed(path, scene)
        assert line["method"] == "mip-NeRF 360, published"
    # A row over all scenes is none of them.
    assert table_rows.published("mean") == table_rows.published("fox") == []
