"""What a run's remedies brought: which score counts."""

import json

import pytest

from alignerf import methods
from alignerf.experiment import targets
from alignerf.experiment.tables import rows as table_rows
from alignerf.tables import misalignment, scores
from alignerf.verdict import gains
from tests import table_cases

ONE = {"model": "base"}
EXTERNAL = {"external": {"train": "t {data} {model}", "render": "r {renders}"}}
# Of each kind, and what it has changed after each round: c for cameras, p for photos.
MOVES = {
    "plain": (ONE | {"rounds": 2}, ["", "p", "p"]),
    "moved": (ONE | {"rounds": 1, "changes": "cameras"}, ["", "c"]),
    "staged": (ONE | {"alignerf": {}}, [""]),
    "aligned_search": (ONE | {"aligned_loss": {}}, [""]),
    "learnt": (ONE | {"pose_optimization": {}}, ["c"]),
    "adjusted_poses": (ONE | {"adjust": True}, ["c"]),
    "aligned": (ONE | {"align": {}}, ["cp"]),
    "still_photos": (ONE | {"align": {"photos_at": []}}, ["c"]),
    "corrected": (ONE | {"auto": True}, ["c"]),
    "still_cameras": (ONE | {"align": {"cameras_at": []}}, ["p"]),
    "program": (EXTERNAL | {"rounds": 2, "changes": "cameras"}, ["", "c", "c"]),
    "given": ({}, [""]),
}


@pytest.fixture
def experiment(demo, experiment_of, tmp_path):
    """Of `MOVES`; its renders that are given lie where they should."""
    methods = {name: method for name, (method, _) in MOVES.items()}
    methods["given"] = {"external": {"renders": f"{tmp_path}/{{scene}}"}}
    (tmp_path / "courtyard").mkdir()
    config = demo | {"methods": methods, "reference": {"method": "plain"}}
    return experiment_of(config)


def test_every_kind_says_what_the_plan_moves(experiment):
    found = {methods.of_method(method) for method in experiment.methods.values()}
    assert found == {*methods.every()}
    rows = {
        (r.method, r.round): r for r in table_rows.of_scene(experiment, "courtyard")
    }
    for name, (_, moves) in MOVES.items():
        method = experiment.methods[name]
        for round, letters in enumerate(moves):
            flags = ("c" in letters, "p" in letters)
            moved = methods.moves(method, round)
            assert ("cameras" in moved, "photos" in moved) == flags, (name, round)
            if row := rows.get((name, round)):
                assert (row.moves_cameras, row.moves_photos) == flags
            if name != "given":
                training = experiment.at("courtyard", name, round)
                planned = (targets.moves_cameras(training), bool(training.warped))
                assert planned == flags, (name, round)
        assert methods.moves(method) == moved


def name_of(experiment, row):
    """By what its record says of it, whatever a user calls it."""
    method = experiment.methods[row.method]
    rounds = "" if not row.round else f" {scores.warping(row.round)}"
    changed = "cameras corrected" if method.changes == "cameras" else "warped"
    words = methods.of_method(method).words(experiment, row.method)
    said = words * methods.of_method(method).in_loop
    return ", ".join([row.method, *[changed + rounds] * bool(rounds), *said])


@pytest.mark.parametrize("more", [(), ("aligned_pose",), ("aligned_pose", "oracle")])
def test_the_verdict_takes_the_test_set_that_is_fair_to_each_kind(
    experiment, tmp_path, more
):
    """Its name is by records and labels, whatever a user calls a method."""
    sets = ("standard", "warped", *more)
    rows = []
    for row in table_rows.of_scene(experiment, "courtyard"):
        gains_db = not (row.method == row.baseline and row.round == 0)
        db = {
            name: [20.0 + gains_db * i, 21.0 + gains_db * i]
            for i, name in enumerate(sets, 1)
        }
        files = table_cases.written(tmp_path, db, row.folder).files
        rows.append(row._replace(files=files))
    table = misalignment.make_table(table_cases.collect(tmp_path, rows))
    table.to_csv(tmp_path / "misalignment.csv", index=False)
    (tmp_path / "timing.json").write_text("{}")
    in_loop = dict.fromkeys(experiment.names("in_loop"), tmp_path / "timing.json")
    assert {*in_loop} == {"aligned", "still_photos", "corrected", "still_cameras"}
    found = gains.of_table(tmp_path / "misalignment.csv", in_loop)
    assert {gain.method for gain in found} == {*MOVES}
    named = {name_of(experiment, row): row for row in rows if row.method}
    for one in found:
        row = named[one.name]
        assert (one.in_loop, one.warped) == (row.moves_cameras, row.moves_photos)
        fair = "aligned_pose" if row.moves_cameras and more else "standard"
        assert one.test_set == ("oracle" if "oracle" in more else fair), one.name
        assert one.db == pytest.approx(1 + sets.index(one.test_set)), one.name
    # Where photos show too little for cameras to be fitted to them.
    is_moved = table["test_set"] == "aligned_pose"
    table.loc[is_moved, scores.with_ends("difference_")] = float("nan")
    table.to_csv(tmp_path / "misalignment.csv", index=False)
    found = gains.of_table(tmp_path / "misalignment.csv", in_loop)
    assert {gain.method for gain in found} == {*MOVES}
    assert "aligned_pose" not in {gain.test_set for gain in found}


@pytest.mark.parametrize(
    ("counts", "most"), [([0, 0], 0), ([0, 7, 3], 7), ([None, 0], 0), ([], None)]
)
def test_the_most_cameras_that_a_training_moved(tmp_path, counts, most):
    """A stop that only warps photos says nothing of cameras."""
    stops = [{} if n is None else {"cameras_moved": n} for n in counts]
    path = tmp_path / "timing.json"
    path.write_text(json.dumps({"alignments": stops}))
    assert gains.cameras_moved(path) == most
    path.write_text("{}")
    assert gains.cameras_moved(path) is None


def table_of(tmp_path, rows):
    """A table of gains; rows: method, field, moves cameras, photos, warping, against,
    dB, and parameters."""
    columns = "method,field,moves_cameras,moves_photos,warping,difference_to,"
    columns += "difference_db,params,difference_low_db,difference_high_db,test_set,"
    lines = [f"{columns}total_time_s"]
    lines += [
        ",".join(map(str, [*row, row[6] - 0.5, row[6] + 0.5, "aligned_pose,60"]))
        for row in rows
    ]
    (tmp_path / "table.csv").write_text("\n".join(lines))
    return tmp_path / "table.csv"


def test_a_name_in_words_says_nothing_twice(tmp_path):
    field = '"grid, cameras corrected, then learned"'
    rows = [
        ("plain", "grid", False, False, "none", "plain", 0.0, 7),
        ("auto", field, True, False, "none", "plain", 1.0, 7),
    ]
    (tmp_path / "timing.json").write_text("{}")
    in_loop = {"auto": tmp_path / "timing.json"}
    (gain,) = gains.of_table(table_of(tmp_path, rows), in_loop)
    assert gain.name == "corrected cameras"


@pytest.mark.parametrize("params", [(7, 8), (8, 7), (7, 7)])
def test_two_baselines_are_told_apart_by_their_sizes(tmp_path, params):
    rows = [
        (name, "grid", False, k > 0, warping, name, 0.5 * k, size)
        for name, size in zip(("one", "other"), params, strict=True)
        for k, warping in enumerate(("none", "once"))
    ]
    found = [gain.name for gain in gains.of_table(table_of(tmp_path, rows), {})]
    words = {7: "small model", 8: "large model"}
    names = [words[n] for n in params] if len({*params}) > 1 else ["one", "other"]
    assert found == [f"{name}, warped once" for name in names]
