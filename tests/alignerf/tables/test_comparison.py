"""Tables 2 and 3: means over scenes, published rows below ours, and rankings."""

import json
import pathlib

import numpy as np
import pandas as pd
import pytest

from alignerf.experiment.tables import regimes, rows
from alignerf.tables import comparison

VIEWS = 6
SETS = ("standard", "warped", "control")
# dB by which a method is above the first.
GAINS = {"nerf": 0.0, "mipnerf360": 2.0, "given": 1.0}


@pytest.fixture
def scenes(tmp_path, rng, monkeypatch):
    """Two scenes of 1x and one of 4x; the third method is another program's renders."""
    monkeypatch.chdir(tmp_path)
    found = []
    for name, share, level in (("a", 1, 20.0), ("b", 1, 24.0), ("long", 4, 21.0)):
        noise = rng.normal(size=VIEWS)
        methods = [
            write_method(rng, name, method, level + noise + gain, share)
            for method, gain in GAINS.items()
        ]
        found.append(regimes.Comparison(name, name, 0, share, methods))
    return found


def write_method(rng, scene, method, psnr_db, share):
    folder = f"results/{scene}/{method}/round0"
    lines = [
        {
            "view": f"view_{view}",
            "test_set": test_set,
            "psnr_db": psnr_db[view] + offset,
            "ssim": 0.5 + 0.01 * psnr_db[view],
            **dict.fromkeys(("lpips_alex", "lpips_squeeze", "lpips_vgg"), np.nan),
        }
        for offset, test_set in zip((0.0, 1.0, 0.1), SETS, strict=True)
        for view in range(VIEWS)
    ]
    path = ready_path(f"{folder}/metrics.csv")
    pd.DataFrame(lines).to_csv(path, index=False)
    trained = method != "given"
    if trained:
        timing = {"train_time_s": 60.0 * share, "steps": 10, "rays_seen": 5120}
        timing["params"] = 1_191_688
        ready_path(f"{folder}/timing.json").write_text(json.dumps(timing))
        tsv = ready_path(f"{folder}/logs/train.tsv")
        tsv.write_text("s\tmax_rss\n61.0\t512.5\n")
    return regimes.Compared(
        method=method,
        round=0,
        parts="renders given" if not trained else method,
        metrics=str(path),
        trainings=[f"{folder}/timing.json"] if trained else [],
        data=[],
        base="nerf",
        published={"nerf": "NeRF", "mipnerf360": "mip-NeRF 360"}.get(method),
        process=f"{folder}/logs/train.tsv" if trained else None,
    )


def ready_path(text):
    path = pathlib.Path(text)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def run(scenes, tmp_path, *more):
    places = {name: str(tmp_path / f"out.{name}") for name in ("csv", "tex")}
    ranking = str(tmp_path / "ranking.csv")
    comparison.main(
        [
            *("--rows", rows.as_json(scenes), "--ranking", ranking),
            *("--csv", places["csv"], "--tex", places["tex"], *more),
        ]
    )
    with open(places["tex"]) as file:
        return pd.read_csv(places["csv"]), file.read(), pd.read_csv(ranking)


def test_means_are_over_scenes_and_gains_paired_by_view(scenes, tmp_path):
    table, tex, _ = run(scenes, tmp_path)
    single = table[table["scene"] != "all"]
    assert single["scene"].drop_duplicates().tolist() == ["a", "b"]
    assert set(single["scenes"]) == {1}
    assert tex.count("\nnerf & ") == 2
    table = table[table["scene"] == "all"]
    one = table[(table["group"] == "1x") & (table["test_set"] == "standard")]
    one = one.set_index("method")
    assert one["scenes"].tolist() == [2, 2, 2]
    assert one["views"].tolist() == [2 * VIEWS] * 3
    of_views = [pd.read_csv(s.methods[0].metrics) for s in scenes[:2]]
    means = [v[v["test_set"] == "standard"]["psnr_db"].mean() for v in of_views]
    assert one.loc["nerf", "psnr_db"] == pytest.approx(np.mean(means), abs=1e-3)
    for method, gain in GAINS.items():
        assert one.loc[method, "difference_db"] == pytest.approx(gain, abs=1e-4)
    # The same gain in every view: nothing is uncertain.
    assert one.loc["given", "difference_low_db"] == pytest.approx(1.0, abs=1e-4)
    assert table["group"].drop_duplicates().tolist() == ["1x", "4x"]
    assert set(table["test_set"]) == set(SETS)


def test_given_renders_cost_nothing_that_is_known(scenes, tmp_path):
    table, tex, _ = run(scenes, tmp_path)
    given = table[table["method"] == "given"]
    assert given[["total_time_s", "params", "memory_mib"]].isna().all(axis=None)
    trained = table[(table["method"] == "nerf") & (table["group"] == "4x")]
    assert trained["total_time_s"].tolist() == [240.0] * len(SETS)
    assert trained["memory_mib"].tolist() == [512.5] * len(SETS)
    assert "nan" not in tex.lower()


def test_published_rows_stand_below_ours(scenes, tmp_path):
    more = ("--published", rows.published_table(), "--published-table", "2")
    table, tex, _ = run(scenes, tmp_path, *more)
    one = table[(table["group"] == "1x") & (table["scene"] == "all")]
    names = one["method"].drop_duplicates().tolist()
    assert names == [
        *("nerf", "NeRF, published", "mipnerf360", "mip-NeRF 360, published", "given"),
        # What no method of ours is called.
        *("mip-NeRF, published", "mip-NeRF with a bigger MLP, published"),
        "AligNeRF, published",
    ]
    printed = one[one["method"] == "mip-NeRF 360, published"].set_index("test_set")
    assert printed.loc["standard", "psnr_db"] == 23.71
    assert printed.loc["warped", "lpips_published"] == 0.349
    assert printed.loc["warped", "params"] == 9_900_000
    assert printed.loc["warped", "total_time_s"] == pytest.approx(6.88 * 3600)
    assert printed["source"].notna().all()
    four = table[(table["group"] == "4x") & table["source"].notna()]
    four = four[four["method"] == "mip-NeRF 360, published"]
    assert four[four["test_set"] == "warped"]["psnr_db"].tolist() == [24.83]
    assert r"\textcolor{gray}{NeRF, published}" in tex


def test_colours_are_for_ours_alone(scenes, tmp_path):
    more = ("--published", rows.published_table(), "--published-table", "2")
    _, tex, _ = run(scenes, tmp_path, *more)
    lines = [line for line in tex.splitlines() if "published" in line and "&" in line]
    assert lines
    assert not any("cellcolor" in line for line in lines)
    best = next(line for line in tex.splitlines() if line.startswith("mipnerf360"))
    assert r"\cellcolor[HTML]{FF9999}" in best


def test_rankings_are_between_all_test_sets(scenes, tmp_path):
    _, _, ranks = run(scenes, tmp_path)
    assert len(ranks) == 2 * 3
    # Each method is above the next one by as much on each set.
    assert ranks["tau"].tolist() == [1.0] * 6
    assert ranks["rows"].tolist() == [3] * 6


def test_a_view_without_a_score_leaves_the_mean_empty(scenes, tmp_path):
    path = scenes[0].methods[1].metrics
    spoilt = pd.read_csv(path)
    spoilt.loc[0, "psnr_db"] = np.nan
    spoilt.to_csv(path, index=False)
    table, _, _ = run(scenes, tmp_path)
    table = table[(table["group"] == "1x") & (table["scene"] == "all")]
    chosen = table[table["method"] == "mipnerf360"]
    chosen = chosen.set_index("test_set")
    assert np.isnan(chosen.loc["standard", "psnr_db"])
    assert np.isfinite(chosen.loc["warped", "psnr_db"])
