"""The schema of the settings: one home for defaults, every number bounded."""

import copy
import json
import typing
from typing import Literal

import jsonschema
import pytest
import yaml

from alignerf import config as config_command
from alignerf import fields
from alignerf.captures import base
from alignerf.courtyard import scene as courtyard
from alignerf.experiment import check
from alignerf.experiment.keys import config as config_keys
from alignerf.experiment.keys import key
from alignerf.systems import mipnerf360
from flow.estimation import estimate, external


@pytest.fixture
def editors(root):
    """The schema that editors read."""
    return yaml.safe_load((root / "workflow/schemas/config.schema.yaml").read_text())


def nodes(found, *place):
    """(place, node) of every mapping in a schema."""
    if isinstance(found, dict):
        yield place, found
        for key, entry in found.items():
            if key != "default":
                yield from nodes(entry, *place, key)
    elif isinstance(found, list):
        for number, entry in enumerate(found):
            yield from nodes(entry, *place, number)


def parts(kind):
    """All classes that a class of keys refers to, and itself."""
    todo, known = [kind], {}
    while todo:
        hint = todo.pop()
        if isinstance(hint, type) and issubclass(hint, key.Keys):
            known[hint.__name__] = hint
            todo += [info.annotation for info in hint.model_fields.values()]
        elif typing.get_origin(hint) is not Literal:
            todo += typing.get_args(hint)
    return known


def plain(value):
    """A default as the schema has it."""
    if isinstance(value, dict):
        return {name: plain(entry) for name, entry in value.items()}
    return value.model_dump() if isinstance(value, key.Keys) else value


def choices(entry):
    """What a key may be, null or not."""
    return [*entry.get("anyOf", [entry])[0]["enum"]]


def test_the_file_for_editors_is_the_schema(root):
    text = (root / "workflow/schemas/config.schema.yaml").read_text()
    assert text == config_command.schema_text()
    jsonschema.Draft202012Validator.check_schema(yaml.safe_load(text))


def test_the_defaults_of_the_schema_are_those_of_the_classes(editors):
    classes, compared = parts(config_keys.Config), 0
    assert classes.keys() == {"Config", *editors["$defs"]}
    for name, made in classes.items():
        said = (editors if name == "Config" else editors["$defs"][name])["properties"]
        assert said.keys() == made.model_fields.keys()
        for word, field in made.model_fields.items():
            if field.is_required():
                continue
            default = plain(made.default(word))
            if "default" in said[word]:
                assert said[word]["default"] == default, (name, word)
                compared += 1
            elif default is not None:
                whole = made.default(word)
                assert whole == type(whole)(), (name, word)
    assert compared > 100


def test_every_number_is_bounded_on_both_sides(editors):
    numbers = 0
    for place, node in nodes(editors):
        if node.get("type") in ("integer", "number"):
            assert "maximum" in node, place
            assert {"minimum", "exclusiveMinimum"} & node.keys(), place
            numbers += 1
        if node.get("type") == "array":
            assert "maxItems" in node, place
    assert numbers > 100


def test_bounds_that_the_program_counts_on(editors):
    assert editors["properties"]["seed"]["maximum"] < 2**32
    rounds = editors["$defs"]["Method"]["properties"]["rounds"]
    assert rounds["maximum"] == 16


def seen(config, editors):
    """`jsonschema.validate` checks the schema itself each time, which takes longer."""
    jsonschema.Draft202012Validator(editors).validate(config)


@pytest.mark.whole
def test_editors_take_every_config_of_ours(editors, root):
    configs = sorted((root / "workflow/config").rglob("*.yaml"))
    assert len(configs) > 10
    for path in configs:
        seen(yaml.safe_load(path.read_text()), editors)


@pytest.mark.parametrize(
    "change",
    [
        {"scenes": {}},
        {"scenes": {"a/b": {"source": "courtyard"}}},
        {"scenes": {"a": {}}},
        {"seed": -1},
        {"seed": "1"},
        {"no_such_key": 1},
        {"models": {"m": {"field": {"kind": "gird"}}}},
        {"models": {"m": {"field": {"kind": "mlp", "levels": 3}}}},
        {"models": {"m": {"field": {"levels": 0}}}},
        {"models": {"m": {"spacing": "linear"}}},
        {"models": {"m": {"training": {"budget_min": 5}}}},
        {"methods": {"m": {"rounds": 17}}},
        {"methods": {"m": {"aligned_loss": {"radius_px": 0}}}},
        {"training": {"learning_rates": [1]}},
    ],
    ids=str,
)
def test_editors_see_what_the_check_refuses(editors, change):
    config = {"scenes": {"a": {"source": "courtyard"}}}
    seen(config, editors)
    with pytest.raises(ValueError, match=r"^config: "):
        check.checked(config | change)
    with pytest.raises(jsonschema.ValidationError):
        seen(config | change, editors)


@pytest.mark.parametrize("number", [float("nan"), float("inf"), -float("inf")])
def test_numbers_that_are_not_finite_are_named(number):
    config = {"scenes": {"a": {"source": "courtyard", "perturb_px": number}}}
    with pytest.raises(ValueError, match=r"config: scenes\.a\.perturb_px: .* finite"):
        check.checked(config)


def test_fields_have_the_defaults_of_their_classes():
    # Flax's own, and what the training decides.
    not_of_the_config = {"parent", "name", "outputs", "moving", "native"}
    kinds = {"grid": mipnerf360.Grid, "mlp": mipnerf360.Mlp, "nerf": mipnerf360.Nerf}
    assert kinds.keys() == fields.KINDS.keys()
    for kind, made in kinds.items():
        module = fields.KINDS[kind]
        wanted = {
            name: field.default
            for name, field in module.__dataclass_fields__.items()
            if name not in not_of_the_config
        }
        found = made().model_dump()
        assert found.pop("kind") == kind
        if kind == "grid":
            found["max_resolution"] = mipnerf360.OF_PROPOSAL
        found = {k: tuple(v) if isinstance(v, list) else v for k, v in found.items()}
        assert found == wanted


def test_the_flow_and_the_sources_have_the_choices_of_their_modules(editors):
    defs = editors["$defs"]
    flow = defs["Flow"]["properties"]
    assert flow["estimator"]["enum"] == [*estimate.METHODS, external.METHOD]
    assert flow["estimator"]["default"] == estimate.DEFAULT
    scene = defs["Scene"]["properties"]
    assert scene["source"]["enum"] == list(base.every())
    ways = {way for source in base.every().values() for way in source.poses}
    assert set(choices(scene["poses"])) == ways
    for motion in defs["Courtyard"]["properties"]["motion"]["enum"]:
        courtyard.draw_displacements(views=2, motion=motion)


def test_three_words_are_a_complete_config(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_photos").mkdir()
    text = "scenes: {my_photos: {source: photos, path: my_photos}}"
    found = check.checked(yaml.safe_load(text))
    assert found.methods["mipnerf360"].rounds == 2
    assert found.methods["alignerf"].alignerf.features == 16
    assert (found.reference.method, found.reference.round) == ("mipnerf360", "last")
    scene, training = found.scenes["my_photos"], found.training
    assert (scene.poses, scene.seed, scene.steps) == ("colmap", 0, 4000)
    assert (training.budget_min, training.warmup_steps) == (None, None)
    assert training.warmup(training.steps) == 400


def test_a_complete_config_means_itself(demo):
    found = check.checked(copy.deepcopy(demo))
    again = check.checked(json.loads(json.dumps(found.model_dump())))
    assert again == found


def test_keys_without_a_kind_change_the_default_field():
    fields_of = {
        "same": {},
        "smaller": {"field": {"log2_hashmap_size": 9}},
        "whole": {"field": {"kind": "grid", "log2_hashmap_size": 9}},
        "other": {"field": {"kind": "mlp", "width": 8}},
        "own": {"proposal": {"kind": "grid"}},
    }
    config = {"scenes": {"a": {"source": "courtyard"}}, "models": fields_of}
    models = check.checked(config | {"methods": {"m": {}}}).models
    same = models["same"].field
    assert (same.max_resolution, models["same"].proposal.max_resolution) == (2048, 256)
    smaller = same.model_copy(update={"log2_hashmap_size": 9})
    assert models["smaller"].field == models["whole"].field == smaller
    assert models["other"].field.depth == mipnerf360.Mlp().depth
    assert models["own"].proposal.max_resolution == 1024


def test_home_is_found(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "photos").mkdir()
    (tmp_path / "vgg.npz").touch()
    config = {
        "scenes": {"a": {"source": "photos", "path": "~/photos"}},
        "frequency_weights": "~/vgg.npz",
        "lpips": {"vgg": "~/vgg.npz", "alex": None},
    }
    found = check.checked(config)
    assert found.scenes["a"].path == str(tmp_path / "photos")
    assert found.frequency_weights == found.lpips.vgg == str(tmp_path / "vgg.npz")
    assert found.lpips.alex is None


def test_real_data_is_where_the_environment_says(tmp_path, monkeypatch):
    path = "${ALIGNERF_DATA:-real data}/fox"
    config = {"scenes": {"fox": {"source": "photos", "path": path}}}
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("ALIGNERF_DATA", raising=False)
    with pytest.raises(ValueError, match=r"fox\.path: real data/fox does not exist"):
        check.checked(copy.deepcopy(config))
    (tmp_path / "real data" / "fox").mkdir(parents=True)
    found = check.checked(copy.deepcopy(config)).scenes["fox"].path
    assert found == "real data/fox"
    monkeypatch.setenv("ALIGNERF_DATA", str(tmp_path / "elsewhere"))
    with pytest.raises(ValueError, match="elsewhere/fox does not exist"):
        check.checked(config)


@pytest.mark.parametrize("value", [5e-324, 1e-40, -1e-45])
@pytest.mark.parametrize(
    ("section", "name"),
    [
        ("models.base", "near"),
        ("models.base", "radius"),
        ("training", "gradient_norm"),
        ("training", "adam_eps"),
        ("training", "learning_rates"),
        ("scenes.yard", "perturb_px"),
    ],
)
def test_a_number_that_float32_has_not_is_named(section, name, value):
    """It would be 0 in JAX: the training would diverge, and nobody know why."""
    config = {"scenes": {"yard": {"source": "courtyard"}}}
    config |= {"models": {"base": {}}, "training": {}}
    part = config
    for inner in section.split("."):
        part = part[inner]
    part[name] = [0.01, value] if name == "learning_rates" else value
    with pytest.raises(ValueError, match=rf"^config: {section}.*{name}"):
        check.checked(config)
    part[name] = [0.01, 0.001] if name == "learning_rates" else 0.1
    check.checked(config)
