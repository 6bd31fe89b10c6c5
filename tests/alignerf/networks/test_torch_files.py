"""State dicts of PyTorch: what is read, and what is refused without being run."""

import os
import pickle
import tracemalloc

import numpy as np
import pytest

from alignerf.networks import torch_files
from tests import torch_writer

SHAPES = {"a.weight": (4, 3, 2, 2), "a.bias": (4,)}


@pytest.fixture(autouse=True)
def torch(monkeypatch):
    torch_writer.fake_torch(monkeypatch)


@pytest.fixture
def arrays(rng):
    found = {
        name: rng.normal(size=shape).astype("<f4") for name, shape in SHAPES.items()
    }
    return {"first": np.zeros(5, "<f4"), **found, "steps": np.array([7], "<i8")}


@pytest.fixture
def read(tmp_path):
    """Read bytes as a file."""

    def read(content, shapes=SHAPES):
        (tmp_path / "net.pth").write_bytes(content)
        return torch_files.read(tmp_path / "net.pth", shapes)

    return read


@pytest.fixture(params=torch_writer.FORMATS.values(), ids=torch_writer.FORMATS)
def written(request):
    return request.param


@pytest.mark.parametrize("parameter", [False, True])
def test_tensors_are_read_as_written(arrays, read, written, parameter):
    found = read(written(torch_writer.state_dict(arrays, parameter=parameter)))
    assert found.keys() == SHAPES.keys()
    for name, array in found.items():
        assert array.dtype == np.float32
        np.testing.assert_array_equal(array, arrays[name])


def test_views_and_other_floats(rng, read, written):
    whole = rng.normal(size=(5, 6))
    state = torch_writer.state_dict({"a": whole})
    state["a"].array = whole.T
    (found,) = read(written(state), {"a": (6, 5)}).values()
    np.testing.assert_array_equal(found, whole.T.astype(np.float32))


@pytest.mark.parametrize(
    "tensor", torch_writer.OLD_WAYS.values(), ids=torch_writer.OLD_WAYS
)
def test_what_python_2_wrote(read, tensor):
    numbers = np.arange(7, dtype="<f4")
    content = torch_writer.head() + torch_writer.old(tensor) + pickle.dumps(["12"], 2)
    content += (7).to_bytes(8, "little") + numbers.tobytes()
    np.testing.assert_array_equal(
        read(content, {"a": (2, 3)})["a"], numbers[1:].reshape(2, 3)
    )


def test_only_what_is_wanted_is_read(read, written):
    small, large = np.ones(3, "<f4"), np.zeros(1 << 22, "<f4")
    content = written(torch_writer.state_dict({"large": large, "small": small}))
    tracemalloc.start()
    read(content, {"small": (3,)})
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < large.nbytes / 8


class Attack:
    def __init__(self, folder):
        self.folder = str(folder)

    def __reduce__(self):
        return os.mkdir, (self.folder,)


def test_nothing_is_executed(tmp_path, read, written, arrays):
    state = torch_writer.state_dict(arrays)
    state["evil"] = Attack(tmp_path / "made")
    state["evil"].key, state["evil"].array = "1", np.zeros(1)
    with pytest.raises(ValueError, match=r"net\.pth: .*global \w+ mkdir"):
        read(written(state))
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        (b"\x80\x02cbuiltins\neval\nX\x03\x00\x00\x001+1\x85R.", "builtins eval"),
        (b"\x80\x02cos\nsystem\nX\x02\x00\x00\x00ls\x85R.", "global os system"),
        # Within what is allowed.
        (b"\x80\x02ccollections\nOrderedDict\ncos\nsystem\n\x85R.", "os system"),
        (b"\x80\x02ctorch\nOther\n.", "global torch Other"),
        # A dotted name would reach what an allowed module imports.
        (b"\x80\x04ctorch._utils\nos.system\n.", "torch._utils os.system"),
        (b"\x80\x04\x8c\x02os\x8c\x06system\x93.", "os system"),
        (b"(S'ls'\nios\nsystem\n.", "os system"),
        (b"\x80\x02(cos\nsystem\no.", "os system"),
        (b"\x80\x02\x82\x01.", "extension"),
    ],
)
def test_other_pickles_are_refused_in_one_line(read, program, reason):
    with pytest.raises(ValueError, match=reason) as caught:
        read(torch_writer.head() + program + pickle.dumps([], 2))
    assert "net.pth" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0, 0.1, 0.5, 0.9])
def test_a_file_cut_short_is_named(arrays, read, written, share):
    content = written(torch_writer.state_dict(arrays))
    with pytest.raises(ValueError, match=r"net\.pth: "):
        read(content[: int(share * len(content))])


def test_a_tensor_that_does_not_fit_is_named(arrays, read, written):
    content = written(torch_writer.state_dict(arrays))
    with pytest.raises(ValueError, match="no tensor b"):
        read(content, {"b": (4,)})
    with pytest.raises(ValueError, match=r"a\.bias is \(4,\) instead of \(5,\)"):
        read(content, {"a.bias": (5,)})
    arrays["a.bias"][2] = np.nan
    with pytest.raises(ValueError, match=r"a\.bias is not finite"):
        read(written(torch_writer.state_dict(arrays)))


def test_no_file(tmp_path):
    with pytest.raises(ValueError, match=r"none\.pth: not found"):
        torch_files.read(tmp_path / "none.pth", SHAPES)


@pytest.mark.usefixtures("ten_seconds")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.pth")
    with pytest.raises(ValueError, match=r"a\.pth: not a file"):
        torch_files.read(tmp_path / "a.pth", SHAPES)
