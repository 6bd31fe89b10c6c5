"""Training states on disk: whole or refused, and never two writers."""

import hashlib
import json
import multiprocessing
import os
from pathlib import Path

import filelock
import flax.serialization
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from alignerf.training import checkpoint
from alignerf.training import step as train_step


@pytest.fixture
def state(rng):
    params = {
        "model": {"field": jnp.asarray(rng.normal(size=(3, 4)), jnp.float32)},
        "head": {"kernel": jnp.asarray(rng.normal(size=5), jnp.float32)},
    }
    optimizer = train_step.make_optimizer(
        learning_rates=(1e-2, 1e-3),
        betas=(0.9, 0.999),
        eps=1e-8,
        steps=10,
        warmup_steps=0,
    )
    step = jnp.asarray(7, jnp.int32)
    return train_step.State(step, params, optimizer.init(params))


def save(folder, state, time_s=2.5, identity="job"):
    checkpoint.save(
        folder,
        state,
        identity=identity,
        time_s=time_s,
        micro_batches=4,
        final={"loss": 0.5},
    )


def restore(folder, state, identity="job"):
    template = jax.tree.map(jnp.zeros_like, state)
    return checkpoint.restore(folder, template, identity=identity)


def same(first, second):
    assert jax.tree.structure(first) == jax.tree.structure(second)
    for a, b in zip(jax.tree.leaves(first), jax.tree.leaves(second), strict=True):
        assert np.asarray(a).dtype == np.asarray(b).dtype
        np.testing.assert_array_equal(a, b)


def test_comes_back_bit_for_bit(tmp_path, state):
    assert restore(tmp_path, state) is None
    save(tmp_path, state)
    found, manifest = restore(tmp_path, state)
    same(found, state)
    assert (manifest["time_s"], manifest["parts"]) == (2.5, 4)
    assert manifest["final"] == {"loss": 0.5}


def test_the_last_two_are_kept(tmp_path, state, caplog):
    """A step that is written twice is one of them; the older one does in need."""
    for step, time_s in ((7, 2.5), (8, 2.75), (9, 2.9), (9, 3.0)):
        save(tmp_path, state._replace(step=jnp.asarray(step, jnp.int32)), time_s)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"state-8.msgpack", "state-9.msgpack", "manifest.json"}
    for step, time_s in ((9, 3.0), (8, 2.75)):
        found, manifest = restore(tmp_path, state)
        same(found, state._replace(step=np.asarray(step, np.int32)))
        assert (manifest["time_s"], manifest["final"]) == (time_s, {"loss": 0.5})
        (tmp_path / f"state-{step}.msgpack").write_bytes(b"damaged")
    assert restore(tmp_path, state) is None
    assert "state-8.msgpack is damaged" in caplog.text


def test_a_damaged_one_is_not_kept_in_place_of_a_whole_one(tmp_path, state):
    """It was resumed from step 7, and saves on its way to step 9 again."""
    for step in (7, 9, 8):
        save(tmp_path, state._replace(step=jnp.asarray(step, jnp.int32)))
        (tmp_path / "state-9.msgpack").write_bytes(b"damaged")
    (tmp_path / "state-8.msgpack").write_bytes(b"damaged")
    same(restore(tmp_path, state)[0], state)


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ("other", "of another configuration, starting anew"),
        ("other/code", "of another configuration, starting anew"),
        ("job/new", "state-7.msgpack is of this configuration by other code, or "),
    ],
)
def test_another_job_starts_anew(tmp_path, state, caplog, other, said):
    """Its first checkpoint leaves that of before, which its own job still finds."""
    save(tmp_path, state, identity="job/code")
    caplog.set_level("INFO", "alignerf")
    assert restore(tmp_path, state, identity=other) is None
    assert said in caplog.text
    save(tmp_path, state._replace(step=jnp.asarray(1, jnp.int32)), identity=other)
    same(restore(tmp_path, state, identity="job/code")[0], state)


def test_a_flipped_byte_anywhere_starts_anew(tmp_path, state, caplog, rng):
    save(tmp_path, state)
    path = tmp_path / "state-7.msgpack"
    whole = path.read_bytes()
    for position in rng.integers(0, len(whole), 20):
        damaged = bytearray(whole)
        damaged[position] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        assert restore(tmp_path, state) is None
    assert "damaged" in caplog.text
    path.write_bytes(whole[:-1])
    assert restore(tmp_path, state) is None
    path.unlink()
    assert restore(tmp_path, state) is None


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", "null", "[" * 10**5])
def test_an_unreadable_manifest_starts_anew(tmp_path, state, content):
    save(tmp_path, state)
    (tmp_path / "manifest.json").write_text(content)
    assert restore(tmp_path, state) is None


@pytest.mark.parametrize(
    "changes",
    [
        *({"file": 3}, {"file": "../state-9.msgpack"}, {"file": "manifest.json"}),
        *({"sha256": None}, {"sha256": "x"}, {"identity": 1}, {"before": 3}),
        *(
            {"before": {"file": "state-7.msgpack"}},
            {"final": {"loss": "x"}},
            {"final": {"loss": float("nan")}},
        ),
        *({"time_s": "x"}, {"time_s": float("inf")}, {"time_s": -1}),
        *({"parts": 0}, {"parts": True}, {"parts": 1.5}, {"parts": None}),
        *({key: ...} for key in checkpoint.MANIFEST),
    ],
)
def test_a_manifest_that_was_changed_starts_anew(tmp_path, state, changes):
    save(tmp_path, state)
    path = tmp_path / "manifest.json"
    found = json.loads(path.read_text()) | changes
    found = {key: value for key, value in found.items() if value is not ...}
    path.write_text(json.dumps(found))
    assert restore(tmp_path, state) is None
    assert checkpoint.read_micro_batches(tmp_path) in (None, 4)


@pytest.mark.parametrize("data", [b"\x91" * 10**5, b"\xdf\xff\xff\xff\xff", b"\x07"])
def test_a_state_of_other_bytes_starts_anew(tmp_path, state, data):
    """Whose digest fits: somebody has made it."""
    save(tmp_path, state)
    path = tmp_path / "manifest.json"
    found = json.loads(path.read_text())
    (tmp_path / found["file"]).write_bytes(data)
    path.write_text(json.dumps(found | {"sha256": hashlib.sha256(data).hexdigest()}))
    assert restore(tmp_path, state) is None


def test_the_steps_of_a_budget_are_those_of_this_very_job(tmp_path, caplog):
    assert checkpoint.read_budget(tmp_path, identity="job") is None
    said = {"steps": 4321, "steps_per_s": 36.25}
    checkpoint.save_budget(tmp_path, identity="job", **said)
    assert checkpoint.read_budget(tmp_path, identity="job") == said
    caplog.set_level("INFO", "alignerf")
    assert checkpoint.read_budget(tmp_path, identity="other") is None
    assert "budget.json: of another configuration or code, timing anew" in caplog.text


@pytest.mark.parametrize(
    "content",
    [
        *("", "[]", "{}", '{"identity": "job"}'),
        '{"identity": "job", "steps": 0, "steps_per_s": 1}',
        '{"identity": "job", "steps": null, "steps_per_s": 1}',
    ],
)
def test_an_unreadable_budget_is_timed_anew(tmp_path, content, caplog):
    (tmp_path / "budget.json").write_text(content)
    assert checkpoint.read_budget(tmp_path, identity="job") is None
    assert "timing anew: " in caplog.text


class Killed(BaseException):
    """A writer that ends in the middle."""


@pytest.mark.parametrize("writes", [0, 1, 2, 3])
def test_a_killed_writer_leaves_the_previous_state_or_the_new_one(
    tmp_path, state, monkeypatch, writes
):
    """Killed before its n-th rename or removal; nothing is lost at any point."""
    save(tmp_path, state)
    done = []

    def dying(act):
        def call(*arguments, **options):
            if len(done) == writes:
                raise Killed
            done.append(arguments)
            return act(*arguments, **options)

        return call

    newer = state._replace(step=jnp.asarray(8, jnp.int32))
    with monkeypatch.context() as patched:
        patched.setattr(os, "replace", dying(os.replace))
        patched.setattr(Path, "unlink", dying(Path.unlink))
        try:
            save(tmp_path, newer, time_s=9.0)
        except Killed:
            assert len(done) == writes
    found, _ = restore(tmp_path, state)
    assert int(found.step) in (7, 8)
    same(found, state if int(found.step) == 7 else newer)
    save(tmp_path, newer, time_s=9.0)
    same(restore(tmp_path, state)[0], newer)


def test_parameters_come_back_and_fit_or_are_refused(tmp_path, state):
    path = tmp_path / "model.msgpack"
    checkpoint.write_params(path, state.params)
    shapes = jax.eval_shape(lambda: state.params)
    same(checkpoint.read_params(path, shapes), state.params)
    wrong = jax.tree.map(lambda x: jnp.zeros((*x.shape, 2)), state.params)
    with pytest.raises(ValueError, match=r"model\.msgpack: .*the model has"):
        checkpoint.read_params(path, wrong)
    other = jax.tree.map(lambda x: x.astype(jnp.int32), state.params)
    with pytest.raises(ValueError, match=r"is float32.*has int32"):
        checkpoint.read_params(path, other)
    with pytest.raises(ValueError, match=r"model\.msgpack: not parameters"):
        checkpoint.read_params(path, {"model": state.params["model"]})
    more = state.params | {"more": jnp.zeros(2)}
    with pytest.raises(ValueError, match=r"model\.msgpack: not parameters"):
        checkpoint.read_params(path, more)
    with pytest.raises(ValueError, match=r"no\.msgpack: not found"):
        checkpoint.read_params(tmp_path / "no.msgpack", shapes)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_parameters_that_are_not_finite_are_refused(tmp_path, state, value):
    path = tmp_path / "model.msgpack"
    spoilt = dict(state.params, head={"kernel": jnp.asarray([0, value, 0, 0, 0.0])})
    checkpoint.write_params(path, spoilt)
    with pytest.raises(ValueError, match=r"head.*kernel.* not finite"):
        checkpoint.read_params(path, state.params)


def test_files_that_are_no_parameters_are_refused(tmp_path, state, rng):
    path = tmp_path / "model.msgpack"
    whole = flax.serialization.to_bytes(state.params)
    for data in (b"", b"\x00", whole[: len(whole) // 2], rng.bytes(500), b"\xc1" * 9):
        path.write_bytes(data)
        with pytest.raises(ValueError, match=r"model\.msgpack: "):
            checkpoint.read_params(path, state.params)


def hold(folder, held, done):
    with filelock.FileLock(folder / "lock"):
        held.set()
        done.wait(60)


def test_a_lock_held_by_another_process_is_refused(tmp_path):
    context = multiprocessing.get_context("spawn")
    held, done = context.Event(), context.Event()
    process = context.Process(target=hold, args=(tmp_path, held, done))
    process.start()
    try:
        assert held.wait(60)
        with (
            pytest.raises(ValueError, match="another process is training here"),
            checkpoint.lock(tmp_path),
        ):
            pytest.fail("two trainers in one folder")
    finally:
        done.set()
        process.join()
    with checkpoint.lock(tmp_path):
        pass
    with checkpoint.lock(tmp_path):
        pass


def test_fingerprints_differ_where_anything_differs():
    parts = [(1,), (1.5,), ("1",), (1, 2), ([1, 2],), ({"a": 1},), ({"b": 1},), (None,)]
    assert len({checkpoint.fingerprint(*part) for part in parts}) == len(parts)
    assert checkpoint.fingerprint({"a": 1, "b": 2}) == checkpoint.fingerprint(
        json.loads('{"b": 2, "a": 1}')
    )
