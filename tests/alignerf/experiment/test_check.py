"""Faults of a config: one line that names the key, or the file and its line."""

import copy
import datetime
import re

import pytest

from alignerf.experiment import check
from alignerf.io import faults, yaml_files


def edit(config, where, value):
    """Set, or for value None delete, the key at the dotted path."""
    *parents, last = where.split(".")
    for key in parents:
        config = config.setdefault(key, {})
    # A dot of the key itself.
    last = last.replace("@", ".")
    if value is None:
        del config[last]
    else:
        config[last] = value


@pytest.mark.parametrize(
    ("where", "value", "reason"),
    [
        ("training.stpes", 5, "training: 'stpes' is no key .*perhaps 'steps'"),
        (
            "models.base.field.levles",
            5,
            r"models.base.field: 'levles' is no key .*'levels'",
        ),
        (
            "models.base.field.kind",
            "gird",
            r"field.kind: 'gird' should be .*'grid', 'mlp'",
        ),
        (
            "models.base.field.levels",
            "8",
            r"field.levels: '8' should .* integer .*out quotes",
        ),
        ("seed", True, "seed: True should be a valid integer"),
        ("training.learning_rates", ["1e-3", 1], r"learning_rates.0: '1e-3' .*1.0e-03"),
        ("training.batch_rays", 0, "batch_rays: 0 should be .* or equal to 1"),
        (
            "flow.estimator",
            "flow",
            "flow.estimator: 'flow' should be 'dis_fast', 'dis_m",
        ),
        (
            "scenes.courtyard.pose_convention",
            "ros90",
            r"pose_convention: 'ros90' should be one of 89 names, such as 'ros[^;]*$",
        ),
        ("flow.estimator", "files", "flow: 'folder' is a required"),
        ("flow.folder", "flows", "flow.folder: estimator 'deepflow' reads none"),
        ("methods.mipnerf360.model", "huge", r"methods.mipnerf360.model: no model 'hu"),
        ("methods.alignerf.rounds", 1, "methods.alignerf.rounds: not beside alignerf"),
        ("methods.pretrain", {"model": "base", "rounds": 0}, "methods.pretrain: a fo"),
        (
            "methods.alignerf.alignerf.radius_px",
            -1,
            "radius_px: -1 should be greater",
        ),
        ("methods.images", {"model": "base", "rounds": 0}, "methods.images: a folder"),
        *(
            ("models.base.near", near, "models.base: near must be smaller than far")
            for near in (1e6, 1e6 * (1 - 1e-7))
        ),
        (
            "models.base.field",
            {"kind": "nerf"},
            "models.base.far: field nerf sees",
        ),
        (
            "methods.aligned",
            {"model": "base", "align": {}, "rounds": 1},
            "methods.aligned.rounds: not beside align",
        ),
        (
            "methods.aligned",
            {"model": "base", "align": {}, "pose_optimization": {}},
            "methods.aligned.pose_optimization: not beside align",
        ),
        (
            "methods.aligned",
            {"model": "base", "align": {"cameras_at": [], "photos_at": []}},
            "methods.aligned.align: cameras_at or photos_at: it needs a share",
        ),
        (
            "methods.aligned",
            {"model": "base", "align": {"photos_at": [0.5, 0.5001]}},
            "methods.aligned.align.photos_at: 0.5001 of 2000 steps is number 1000",
        ),
        (
            "methods",
            {"alone": {"model": "base", "align": {}}},
            "methods.alone.align: it needs another method of model 'base'",
        ),
        (
            "methods.aligned",
            {"model": "base", "align": {"cameras_at": [1.0]}},
            "methods.aligned.align.cameras_at.0: 1.0 should be less .* 0.99",
        ),
        ("small", False, "small: false needs full_size"),
        ("full_size", {"sed": 1}, "full_size: 'sed' is no key .*'seed'"),
        ("full_size", {"training": {"step": 1}}, "full_size.training: 'step' is no"),
        ("full_size", {"small": True}, "full_size.small: is of the config itself"),
        ("full_size", {"scenes": {3: {}}}, "full_size.scenes.3: a name must be text"),
        (
            "methods.joint",
            {"model": "base", "pose_optimization": {"coarse_to_fine": [0.5, 0.1]}},
            "methods.joint.pose_optimization.coarse_to_fine: two shares, first < last",
        ),
        (
            "methods.joint",
            {"model": "base", "pose_optimization": {"delay_fraction": 0.7}},
            "methods.joint.pose_optimization.end_fraction: not after the delay .0.6 if",
        ),
        (
            "methods.joint",
            {"model": "base", "pose_optimization": {"delay_fraction": 0.05}},
            "methods.joint.pose_optimization.delay_fraction: before 0.1 of the steps",
        ),
        ("scenes.published", {"source": "courtyard"}, "scenes.published: a file of"),
        ("scenes.mine", {"source": "photos", "path": "a{b}"}, "scenes.mine.path: a{b}"),
        ("reference.method", "nerf", "reference.method: no method 'nerf'"),
        ("reference.round", 3, "reference.round: mipnerf360_large has fewer"),
        (
            "reference.round",
            "first",
            "reference.round: 'first' should be .* integer or be 'last'",
        ),
        ("methods.mipnerf360.rounds", "auto", "rounds: 'auto' should be .* integer"),
        ("methods.mipnerf360.warm_start", {}, "'warm_start' is no key .* from scratch"),
        ("methods.mipnerf360.max_rounds", 2, "'max_rounds' is no key .* two are"),
        (
            "methods.moved",
            {"model": "base", "rounds": 0, "changes": "cameras"},
            "methods.moved.changes: cameras need a round",
        ),
        (
            "methods.mipnerf360.changes",
            "cameras_then_photos",
            "changes: 'cameras_then_photos' should be 'photos' or 'cameras'",
        ),
        ("scenes.a/b", {"source": "courtyard"}, "scenes: 'a/b' should match"),
        ("scenes.a\n", {"source": "courtyard"}, r"scenes: 'a\\n' should match"),
        ("scenes.mine", {"source": "photos"}, "scenes.mine.path: source 'photos'"),
        ("lpips.vgg19", "no.npz", "lpips: 'vgg19' is no key .*'vgg'"),
        ("lpips.alex", 3, "lpips.alex: 3 should be a valid string"),
        ("scenes.tradeoff@csv", {"source": "courtyard"}, "tradeoff.csv: a file of"),
        (
            "scenes.courtyard.courtyard.moving",
            ["arm", "unicorn"],
            "scenes.courtyard.courtyard.moving.1: 'unicorn' should be .*'tin' or 'arm'",
        ),
        ("methods.comparison", {"model": "base", "rounds": 0}, "comparison: a folder"),
        ("training.budget_min", 2, "training.budget_min: not beside steps, choose one"),
        ("scenes.mine", {"source": "photos", "path": ""}, "mine.path: '' should match"),
        (
            "scenes.mine",
            {"source": "courtyard", "steps": 5, "budget_min": 2},
            "scenes.mine.budget_min: not beside steps",
        ),
        ("training", {"budget_min": 0}, "training.budget_min: 0 should be greater"),
        (
            "training",
            {"budget_min": 14401},
            "budget_min: 14401 should be less than .* 14400",
        ),
        (
            "training",
            {"budget_min": "2 min"},
            "budget_min: '2 min' should be a valid number",
        ),
        ("scenes.courtyard.budget_min", -1, "courtyard.budget_min: -1 should be"),
    ],
)
def test_a_bad_config_is_named(demo, where, value, reason):
    edit(demo, where, value)
    with pytest.raises(ValueError, match="^config: .*" + reason):
        check.checked(demo)


def test_staged_methods_agree_about_their_pretraining(demo):
    demo["methods"]["other"] = {"model": "base", "alignerf": {"patches": 1}}
    check.checked(demo)
    demo["methods"]["other"]["alignerf"]["pretrain_fraction"] = 0.5
    reason = "methods.alignerf.alignerf.pretrain_fraction: methods.other has another"
    with pytest.raises(ValueError, match=reason):
        check.checked(demo)


def test_a_name_that_yaml_reads_as_a_number_is_named(demo):
    demo["scenes"][7] = {"source": "courtyard"}
    with pytest.raises(ValueError, match=r"config: scenes\.7: a name must be text"):
        check.checked(demo)


def test_no_scene_can_have_the_name_of_a_rule():
    check.check_free(["courtyard"], ["train", "poses"])
    with pytest.raises(ValueError, match=r"scenes\.train: a rule has this name"):
        check.check_free(["courtyard", "train"], ["train", "poses"])


def test_a_fault_is_one_line_and_an_exit_code(capsys):
    def fail():
        raise ValueError("two\nlines")

    with pytest.raises(SystemExit) as stopped:
        faults.or_exit(fail)
    assert stopped.value.code == 1
    assert capsys.readouterr().err == "error: two lines\n"
    assert faults.or_exit(lambda: 3) == 3


TEMPLATE = "{scene}/{method}/{round}/{split}"


@pytest.mark.parametrize(
    "folder",
    [
        *("flows/{view}", "flows/{}", "flows/{scene", "{0}"),
        *("{scene:>999999999}", "{scene.__class__}", "{scene!r}"),
    ],
)
def test_the_folder_of_flows_knows_four_names(demo, folder):
    demo["flow"] = {"estimator": "files", "folder": TEMPLATE}
    assert check.checked(demo).flow.folder == TEMPLATE
    demo["flow"]["folder"] = folder
    with pytest.raises(ValueError, match=r"config: flow\.folder: .*in braces only"):
        check.checked(demo)


@pytest.mark.parametrize(("rounds", "good"), [(1, True), (2, False)])
def test_flows_of_several_rounds_know_their_round(demo, rounds, good):
    """Or a second round would correct by what the first one's renders show, again."""
    demo["methods"] = {"mipnerf360": {"rounds": rounds, "changes": "cameras"}}
    demo["flow"] = {"estimator": "files", "folder": "flows/{scene}/{method}/{split}"}
    if good:
        assert check.checked(demo)
        return
    with pytest.raises(ValueError, match=r"flow\.folder: .* without \{round\} every"):
        check.checked(demo)


def test_a_scene_larger_than_a_machine_is_named():
    size = {"views": 10000, "width": 16384, "height": 16384}
    config = {"scenes": {"a": {"source": "courtyard", "courtyard": size}}}
    with pytest.raises(ValueError, match=r"scenes\.a\.courtyard: .* more than 32 GiB"):
        check.checked(config)


def deep(value):
    """A mapping in a mapping, deeper than Python calls functions."""
    for _ in range(5000):
        value = {"x": value}
    return value


COURTYARD = {"a": {"source": "courtyard"}}
ZOOMED = {"source": "courtyard", "courtyard": {"zooms": [0.5]}}
# 48 views, of which six are held out.
SEVEN = {"source": "courtyard", "courtyard": {"zooms": [1] * 7}}


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"seed": 1.0}, "seed: 1.0 should be a valid integer"),
        (
            {"methods": {"m": {"rounds": 2.0}}},
            "m.rounds: 2.0 should be .* integer",
        ),
        (
            {"models": {"m": {"samples": [32.0, 16]}}},
            "samples.0: 32.0 should be .* integer",
        ),
        ({"training": None}, "training: None should be a mapping"),
        ({"methods": {"m": None}}, "methods.m: None should be a mapping"),
        ({"scenes": {"a" * 300: {"source": "courtyard"}}}, "scenes: 'aaa"),
        ({"seed": datetime.date(2026, 1, 2)}, "seed: datetime.date.* valid integer"),
        ({"vary": {"seeds": {1, 2}}}, r"vary.seeds: \{1, 2\} should be a valid list"),
        ({"vary": {"seeds": [1] * 10**5}}, "vary.seeds: .* at most 100 items"),
        ({"training": {3: 1}}, "training: 3 is no key"),
        ({"training": {None: 1}}, "training: None is no key"),
        ({"training": 10**4200}, "training: 10+.*0+ should be a mapping"),
        ({"seed": 16**5000}, "seed: int of too many digits should be less"),
        ({"seed": deep({})}, "seed: .* should be a valid integer"),
        (
            {"models": {"m": {"field": {"degrees": 4}}}},
            "models.m.field: 'degrees' is no key",
        ),
        (
            {"scenes": {"table1_effects.csv": {"source": "courtyard"}}},
            "scenes.table1_effects.csv: a file of the results",
        ),
        (
            {"scenes": {"a": {"source": "photos", "path": "x" * 300}}},
            "scenes.a.path: x+ does not exist",
        ),
        (
            {"scenes": {"a": {"source": "photos", "path": "~nobody123/x"}}},
            "~nobody123/x: no such user's home",
        ),
        (
            {"scenes": {"a": ZOOMED}},
            "scenes.a.courtyard.zooms: other than 1 needs poses: truth",
        ),
        (
            {"scenes": {"a": SEVEN}},
            "scenes.a.courtyard.zooms: 7 of them are more than there are test views",
        ),
        (
            {"scenes": {"a": COURTYARD["a"] | {"crop": {"of": "b", "px": 31}}}},
            "scenes.a.crop.px: 31 should be greater",
        ),
        (
            {"models": {"m": {"field": {"log2_hashmap_size": 26, "features": 64}}}},
            "models.m.field: .* GiB to train are more than 256 GiB",
        ),
    ],
)
def test_what_would_fail_later_is_named_now(change, reason):
    with pytest.raises(ValueError, match="^config: .*" + reason) as caught:
        check.checked({"scenes": COURTYARD} | change)
    assert len(str(caught.value)) < 600
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("config", [[1, 2], "hello", 5])
def test_a_config_is_a_mapping(config):
    with pytest.raises(ValueError, match="config: top level: a config is a mapping"):
        check.checked(config)


def test_configs_share_no_values():
    config = {"scenes": COURTYARD, "models": {"m": {}}}
    first = check.checked(config)
    first.models["m"].samples.append(7)
    first.training.adam_betas.append(7)
    again = check.checked(config)
    assert again.models["m"].samples == [32, 16, 12]
    assert again.training.adam_betas == [0.9, 0.99]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("? [1, 2]\n: 3", "unhashable|not a hashable|unacceptable key"),
        ("training: {<<: 5}", "expected a mapping"),
        ("seed: !foo 3", "could not determine a constructor"),
        ("seed: !!python/object/apply:os.getcwd []", "could not determine a const"),
        (b"\xff\xfe\xff", "can.t decode|unacceptable character"),
        ("seed: " + "9" * 5000, "4300 digits"),
    ],
)
def test_what_cannot_be_read_is_named_with_its_file(tmp_path, text, reason):
    path = tmp_path / "a.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=reason) as caught:
        yaml_files.read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("seed: 1\nseed: 2", "key 'seed' stands twice, see line 2"),
        ("scenes: {a: 1, a: 2}", "key 'a' stands twice, see line 1"),
        ("[" * 5000 + "]" * 5000, "nested too deeply"),
        ("scenes: [", "while parsing"),
    ],
)
def test_what_yaml_takes_without_a_word_is_named(tmp_path, text, reason):
    path = tmp_path / "my config.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=reason) as caught:
        yaml_files.read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("folder", "meant"),
    [("a <x> b", "<x>"), ("<results>", "<results>"), ("{x}", "braces")],
)
@pytest.mark.parametrize("key", ["path", "masks", "renders"])
def test_a_path_that_snakemake_would_read_otherwise_is_named(
    demo, tmp_path, folder, meant, key
):
    place = tmp_path / folder
    place.mkdir()
    own = {"source": "photos", "path": str(tmp_path)}
    if key == "renders":
        demo["methods"]["theirs"] = {"external": {"renders": str(place)}}
    else:
        own[key] = str(place)
    demo["scenes"] = {"a": own}
    with pytest.raises(ValueError, match=rf"{key}: .*{meant}"):
        check.checked(demo)


@pytest.mark.parametrize("name", ["3 < 4 > 2", "<3>", "a<b", "<A>"])
def test_other_angles_mean_nothing(demo, tmp_path, name):
    (tmp_path / name).mkdir()
    demo["scenes"] = {"a": {"source": "photos", "path": str(tmp_path / name)}}
    check.checked(demo)


@pytest.mark.parametrize("name", ["a" * 20, "b" + "a" * 21, "ab" * 20, "0" * 30])
@pytest.mark.parametrize("section", ["scenes", "methods", "models"])
def test_a_name_that_snakemake_takes_for_a_loop_is_refused(demo, section, name):
    entries = demo[section]
    entries[name] = next(iter(entries.values()))
    with pytest.raises(ValueError, match=rf"config: {section}\.{name}: .* 20 times"):
        check.checked(demo)


def test_a_name_of_many_equal_letters_may_go_on(demo):
    demo["scenes"]["a" * 19] = demo["scenes"]["a" * 30 + "_b"] = {"source": "courtyard"}
    check.checked(demo)


@pytest.mark.parametrize(
    ("section", "old", "new"),
    [
        ("", {"windows": {}}, "crops"),
        ("scenes.courtyard", {"zoom": {}}, "crop"),
        ("scenes.courtyard", {"source": "judged"}, "external_renders"),
        ("scenes.courtyard", {"poses": "given"}, "input"),
        ("methods.mipnerf360", {"refine": {}}, "pose_optimization"),
        ("models.base", {"field": {"finest": 512}}, "max_resolution"),
        ("training", {"hold_share": 0.5}, "hold_fraction"),
    ],
)
def test_keys_of_earlier_versions_are_refused_with_the_new(demo, section, old, new):
    place = demo
    for name in section.split(".") if section else ():
        place = place.setdefault(name, {})
    place |= old
    with pytest.raises(ValueError, match=f"(called|is) '{new}' now$"):
        check.checked(demo)


@pytest.mark.parametrize(
    ("where", "value", "instead"),
    [
        ("methods.mipnerf360.alignerf", {"dilation": 6}, r"`aligned_loss: \{\}`"),
        ("regimes", "mine", "`snakemake comparison` .* `table4`"),
    ],
)
def test_removed_keys_are_refused_with_what_replaces_them(demo, where, value, instead):
    edit(demo, where, value)
    with pytest.raises(ValueError, match=f"is no key .*{instead}"):
        check.checked(demo)


@pytest.mark.parametrize(
    ("where", "told"),
    [
        ("lpips.vgg", "no.npz does not exist: no column lpips_vgg"),
        ("frequency_weights", "no.npz does not exist: the high-frequency loss takes "),
    ],
)
def test_weights_that_are_not_there_are_told_once_and_left_out(
    demo, where, told, monkeypatch, capsys
):
    monkeypatch.setattr(check, "TOLD", set())
    without = check.checked(copy.deepcopy(demo))
    edit(demo, where, "no.npz")
    for _ in range(2):
        assert check.checked(copy.deepcopy(demo)) == without
    assert re.fullmatch(f"warning: {where}: {told}.*\n", capsys.readouterr().err)


def test_a_users_own_names_may_be_of_an_earlier_version(demo):
    demo["methods"] |= {"refine": {"model": "base"}, "windows": {"model": "base"}}
    assert {"refine", "windows"} < check.checked(demo).methods.keys()
