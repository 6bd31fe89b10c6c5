"""Tables 2 and 3: means over scenes, published rows below ours, and rankings."""

import numpy as np
import pandas as pd
import pytest

from alignerf import tabulate
from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import latex, published
from alignerf.tables.across import comparison
from tests import table_cases
from tests.table_cases import made, one

VIEWS = 6
SETS = {"standard": 0.0, "warped": 1.0, "control": 0.1}
# dB by which a method is above the first, and what papers call it.
GAINS = {"nerf": 0.0, "mipnerf360": 2.0, "given": 1.0}
NAMES = {"nerf": "NeRF", "mipnerf360": "mip-NeRF 360"}


@pytest.fixture
def scenes(rng):
    """Two scenes of 1x and one of 4x; the third method is another program's renders."""
    return [
        scene_of(name, share, level + rng.normal(size=VIEWS))
        for name, share, level in (("a", 1, 20.0), ("b", 1, 24.0), ("long", 4, 21.0))
    ]


def scene_of(name, share, views_db, **fields):
    """A scene whose methods gain GAINS in each view."""
    costs = {"total_time_s": 60.0 * share, "memory_mib": 512.5}
    rows = [
        table_cases.row(
            {test_set: views_db + gain + more for test_set, more in SETS.items()},
            method,
            costs={} if method == "given" else costs,
            published=NAMES.get(method),
        )
        for method, gain in GAINS.items()
    ]
    return table_cases.scored(name, rows, share=share, **fields)


@pytest.fixture
def printed():
    """What the paper's Table 2 prints."""
    return published.lines(table_rows.published_table(), 2)


def of_all(table, **keys):
    """Lines of means over all scenes, by method."""
    keys = {"scene": comparison.ALL} | keys
    chosen = np.logical_and.reduce([table[key] == value for key, value in keys.items()])
    return table[chosen].set_index("method")


def test_means_are_over_scenes_and_gains_paired_by_view(scenes):
    table = made(comparison.make_table, scenes)
    single = table[table["scene"] != comparison.ALL]
    assert single["scene"].drop_duplicates().tolist() == ["a", "b"]
    assert set(single["scenes"]) == {1}
    tex = comparison.to_latex(table)
    assert [cells[0] for cells in table_cases.cells(tex)].count("nerf") == 0
    assert [cells[1] for cells in table_cases.cells(tex)].count("nerf") == 2
    means = of_all(table, group="1x", test_set="standard")
    assert means["scenes"].tolist() == [2, 2, 2]
    assert means["views"].tolist() == [2 * VIEWS] * 3
    views = [
        table_cases.psnr(scene, "standard", method="nerf").mean()
        for scene in scenes[:2]
    ]
    assert means.loc["nerf", "psnr_db"] == pytest.approx(np.mean(views))
    for method, gain in GAINS.items():
        assert means.loc[method, "difference_db"] == pytest.approx(gain)
    # The same gain in every view: nothing is uncertain.
    assert means.loc["given", "difference_low_db"] == pytest.approx(1.0)
    assert table["group"].drop_duplicates().tolist() == ["1x", "4x"]
    assert set(table["test_set"]) == set(SETS)


def test_seeds_of_a_scene_are_together(scenes, rng):
    again = scene_of("a2", 1, rng.normal(size=VIEWS), seed=1, alike="a")
    table = made(comparison.make_table, [*scenes, again])
    single = table[table["scene"] != comparison.ALL]
    assert single["scene"].drop_duplicates().tolist() == ["a", "b"]
    assert set(single[single["scene"] == "a"]["scenes"]) == {2}


def test_a_round_that_some_scene_lacks_is_left_out(scenes):
    own = scenes[0][scenes[0]["method"] == "mipnerf360"]
    scenes[0] = pd.concat([scenes[0], own.assign(round=1)])
    table = made(comparison.make_table, scenes)
    lines = table[table["warping"] == "once"]
    assert set(lines["scene"]) == {"a"}


def test_given_renders_cost_nothing_that_is_known(scenes):
    table = made(comparison.make_table, scenes)
    given = table[table["method"] == "given"]
    assert given[["total_time_s", "params", "memory_mib"]].isna().all(axis=None)
    trained = of_all(table, group="4x").loc["nerf"]
    assert set(trained["total_time_s"]) == {240.0}
    assert set(trained["memory_mib"]) == {512.5}
    tex = comparison.to_latex(table)
    assert "nan" not in tex.lower()
    (given, *_) = (row for row in table_cases.cells(tex) if row[1] == "given")
    assert given[-2:] == ["--", "--"]


def test_published_rows_stand_below_ours(scenes, printed):
    table = made(comparison.make_table, scenes, printed)
    lines = of_all(table, group="1x")
    assert list(dict.fromkeys(lines.index)) == [
        *("nerf", "NeRF, published", "mipnerf360", "mip-NeRF 360, published", "given"),
        # What no method of ours is called.
        *("mip-NeRF, published", "mip-NeRF with a bigger MLP, published"),
        "AligNeRF, published",
    ]
    name = "mip-NeRF 360, published"
    lines = lines.loc[name].set_index("test_set")
    assert lines.loc["standard", "psnr_db"] == 23.71
    assert lines.loc["warped", "lpips_published"] == 0.349
    assert lines.loc["warped", "params"] == 9_900_000
    assert lines.loc["warped", "total_time_s"] == pytest.approx(6.88 * 3600)
    assert lines["source"].notna().all()
    four = one(table, group="4x", method=name, test_set="warped")
    assert four["psnr_db"] == 24.83


def test_colours_are_for_ours_alone(scenes, printed):
    tex = comparison.to_latex(made(comparison.make_table, scenes, printed))
    # Length, method; PSNR, SSIM and the paper's LPIPS; minutes, parameters.
    assert table_cases.check_document(latex.document(tex)) == 7
    assert r"\textcolor{gray}{NeRF, published}" in tex
    lines = [line for line in tex.splitlines() if "published" in line and "&" in line]
    lines = [line for line in lines if "textcolor" in line]
    assert lines
    assert not any("cellcolor" in line for line in lines)
    best = next(line for line in tex.splitlines() if "& mipnerf360 " in line)
    assert r"\cellcolor[HTML]{FF9999}" in best
    # Each length has a best of its own.
    rows = [line for line in tex.splitlines() if "& mipnerf360 " in line]
    assert [r"\cellcolor[HTML]{FF9999}" in line for line in rows] == [True, True]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (
            lambda table: pd.concat([table, table[-1:]]),
            "table 4: a method stands twice",
        ),
        (lambda table: table.drop(columns="ssim"), ".*: no column ssim"),
    ],
)
def test_a_published_table_that_is_none_is_named(tmp_path, change, reason):
    path = tmp_path / "tables.csv"
    change(pd.read_csv(table_rows.published_table())).to_csv(path, index=False)
    with pytest.raises(ValueError, match=rf"tables\.csv: {reason}"):
        published.lines(path, 4)


def test_rankings_are_between_all_test_sets(scenes):
    ranks = made(comparison.make_ranking, scenes)
    assert len(ranks) == 2 * 3
    # Each method is above the next one by as much on each set.
    assert ranks["tau"].tolist() == [1.0] * 6
    assert ranks["rows"].tolist() == [3] * 6


def test_a_set_that_some_method_lacks_ranks_the_others(scenes):
    lost = {"method": "given", "test_set": "control"}
    scenes = [table_cases.without(scene, **lost) for scene in scenes]
    ranks = made(comparison.make_ranking, scenes)
    assert ranks["rows"].tolist() == [3, 2, 2] * 2
    table = made(comparison.make_table, scenes)
    assert set(of_all(table).loc["given", "test_set"]) == {"standard", "warped"}


def test_as_a_command(tmp_path):
    folder = tmp_path / "a"
    db = {"standard": [20.0, 22.0], "warped": [21.0, 25.0]}
    rows = [
        table_cases.written(folder, db, method, base="nerf", published=called)
        for method, called in (("nerf", "AligNeRF"), ("b", "mip-NeRF 360"))
    ]
    views = {"names": ["v0", "v1", "t"], "split": ["test", "test", "train"]}
    lens = {"pixtocams": [np.eye(3)] * 3, "camtoworlds": [np.eye(3, 4)] * 3}
    np.savez(folder / "cameras.npz", **views, **lens, width=5, height=2)
    table_cases.collect(folder, rows, "comparison")
    scene = table_cases.scene_like("a", reference="nerf")
    options = {"table": "comparison", "out": tmp_path / "out", "results": tmp_path}
    options |= {"scenes": table_rows.as_json([scene])}
    options |= {"published": table_rows.published_table(), "published-table": 3}
    tabulate.main([f"--{name}={value}" for name, value in options.items()])
    table = pd.read_csv(tmp_path / "out.csv")
    assert table["method"].drop_duplicates().tolist()[:2] == [
        "nerf",
        "AligNeRF, published",
    ]
    assert table["source"].notna().any()
    assert set(table["memory_mib"].dropna()) == {1.5}
    assert len(pd.read_csv(tmp_path / "out_ranking.csv")) == 1
    effects = pd.read_csv(tmp_path / "out_effects.csv")
    row = one(effects, effect="AligNeRF", method="nerf", over="b")
    # All rays over the pixels of the one training photo.
    assert (row["warped_db"], row["epochs"], row["reproduced"]) == (0, 5, "one seed")
    assert set(effects["reproduced"]) == {"one seed", "not tested"}
    assert (tmp_path / "out.provenance.json").is_file()
