"""Rows as papers print them stand below ours, and compare with nothing."""

import pandas as pd
import pytest

from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import misalignment
from tests import table_cases


def cells(tex):
    """The body's cells, row by row."""
    body = tex.split(r"\midrule")[1].split(r"\bottomrule")[0]
    lines = [line for line in body.splitlines() if "&" in line]
    rows = [line.strip().removesuffix(r"\\").split("&") for line in lines]
    return [[cell.strip() for cell in row] for row in rows]


@pytest.fixture
def printed(tmp_path):
    """A table as papers print it."""
    path = tmp_path / "means.csv"
    path.write_text(
        "source,method,scene,psnr_db,ssim,lpips_published\n"
        "arXiv 1,mip-NeRF 360,garden,99,0.813,0.17\n"
        "arXiv 1,mip-NeRF 360,mean,24.47,0.691,0.283\n"
        "arXiv 2,mip_NeRF,garden,26,0.8,0.2\n"
    )
    return path


def run(entry, folder, *more):
    """The command's CSV and LaTeX for one row."""
    csv, tex = table_cases.make("misalignment", [entry], folder, *more)
    return pd.read_csv(csv), tex.read_text()


def test_published_rows_stand_below_and_compare_with_nothing(entry, tmp_path, printed):
    alone, tex_alone = run(entry, tmp_path)
    more = ("--published", str(printed), "--scene-name", "garden")
    table, tex = run(entry, tmp_path, *more)
    pd.testing.assert_frame_equal(table[:3], alone, check_dtype=False)
    rows = table[3:].set_index("method")
    names = ["mip-NeRF 360, published", "mip_NeRF, published"]
    assert list(rows.index) == names
    assert list(rows["source"]) == ["arXiv 1", "arXiv 2"]
    assert list(rows["test_set"]) == ["standard"] * 2
    assert list(rows["psnr_db"]) == [99, 26]
    assert list(rows["lpips_published"]) == [0.17, 0.2]
    empty = [*misalignment.COUNTS, "total_time_s", "lpips_alex", "difference_db"]
    assert rows[empty].isna().all(axis=None)
    above, below = tex.split(r"\bottomrule")[0].split(r"\midrule")[1:]
    # The 99 dB are not the best: they are nobody's of these.
    assert r"\cellcolor[HTML]{FF9999}" in above
    assert "cellcolor" not in below
    assert "99.00" in below
    assert r"mip\_NeRF, published" in below
    assert "0.170" in below
    assert "% mip-NeRF 360, published: as printed, arXiv 1." in tex
    assert "LPIPS (published)" in tex
    assert "nan" not in tex.lower()
    assert "published" not in tex_alone
    assert tex_alone.count(r"\midrule") == 1


def test_of_other_scenes_nothing_is_printed(entry, tmp_path, printed):
    more = ("--published", str(printed), "--scene-name", "fox")
    table, tex = run(entry, tmp_path, *more)
    alone, tex_alone = run(entry, tmp_path)
    pd.testing.assert_frame_equal(table, alone)
    assert tex == tex_alone


def test_a_published_table_that_is_none_is_named(entry, tmp_path, printed):
    more = ("--published", str(printed), "--scene-name", "garden")
    text = printed.read_text()
    printed.write_text(text.replace("mip_NeRF", "mip-NeRF 360"))
    with pytest.raises(ValueError, match=r"means\.csv: scene garden: a method stands"):
        run(entry, tmp_path, *more)
    printed.write_text(text.replace("ssim", "SSIM"))
    with pytest.raises(ValueError, match=r"means\.csv: .*: no column ssim"):
        run(entry, tmp_path, *more)
    assert not (tmp_path / "misalignment.csv").exists()


def test_scenes_of_the_papers_are_known_by_their_names(root):
    for scene in ("bicycle", "flowers", "garden", "stump", "treehill"):
        path, *_ = table_rows.published(scene)
        assert path == str(root / "results/published/scenes.csv")
        (line,) = misalignment.published(path, scene)
        assert line["method"] == "mip-NeRF 360, published"
    # A row over all scenes is none of them.
    assert table_rows.published("mean") == table_rows.published("fox") == []
