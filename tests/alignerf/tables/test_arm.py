"""The table of the moving arm: two places, each set against the first row."""

import numpy as np
import pytest

from alignerf.tables.across import arm
from tests import table_cases
from tests.table_cases import made


@pytest.mark.parametrize("views", [1, 4])
def test_right_poses_stand_first_and_differences_are_to_them(rng, views):
    db = {
        name: {one: rng.uniform(15, 25, views) for one in arm.PLACES.values()}
        for name in ("barf", "nerf", "other")
    }
    # No pixel moves in this view: it has no part in what moves.
    for sets in db.values():
        sets["oracle_moving"] = np.append(sets["oracle_moving"], np.nan)
        sets["oracle_still"] = np.append(sets["oracle_still"], rng.uniform(15, 25))
    scenes = [
        table_cases.scored(
            f"yard_{place}", [table_cases.row(sets, name)], perturb_px=px
        )
        for place, ((name, sets), px) in enumerate(
            zip(db.items(), (2, 0, 0), strict=True)
        )
    ]
    for scene in scenes:
        scene.loc[scene["psnr_db"].isna(), "ssim"] = np.nan
    table = made(arm.make_table, scenes)
    assert table["method"].tolist() == ["nerf", "other", "barf"]
    assert set(table["views"]) == {views + 1}
    for line in table.to_dict("records"):
        for place, name in arm.PLACES.items():
            own, first = db[line["method"]][name], db["nerf"][name]
            assert line[f"{place}_db"] == pytest.approx(np.nanmean(own))
            gain = pytest.approx(np.nanmean(own - first))
            assert line[f"{place}_difference_db"] == gain
    cells = table_cases.cells(arm.to_latex(table))
    assert {len(row) for row in cells} == {8}
    assert [bool(cell) for cell in cells[0]] == [True] * 3 + [
        False,
        True,
        False,
        True,
        True,
    ]
    assert all(all(row) for row in cells[1:])
