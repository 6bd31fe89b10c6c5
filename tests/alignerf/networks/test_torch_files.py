"""State dicts of PyTorch: what is read, and what is refused without being run."""

import os
import pickle
import tracemalloc
import zipfile

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


# What stands in it has its attributes set by a pickle.
BUILT = b"\x80\x02%sN}X\x0c\x00\x00\x00__setstate__K\x01s\x86b."


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        (b"\x80\x02cbuiltins\neval\nX\x03\x00\x00\x001+1\x85R.", "builtins eval"),
        (b"\x80\x02cos\nsystem\nX\x02\x00\x00\x00ls\x85R.", "global os system"),
        # Within what is allowed.
        (b"\x80\x02ccollections\nOrderedDict\ncos\nsystem\n\x85R.", "os system"),
        (b"\x80\x02ctorch\nOther\n.", "global torch Other"),
        (b"\x80\x02cpickle\nload_build\n.", "global pickle load_build"),
        # A dotted name would reach what an allowed module imports.
        (b"\x80\x04ctorch._utils\nos.system\n.", "torch._utils os.system"),
        (b"\x80\x04\x8c\x02os\x8c\x06system\x93.", "opcode SHORT_BINUNICODE"),
        (b"(S'ls'\nios\nsystem\n.", "opcode STRING"),
        (b"\x80\x02(ios\nsystem\n.", "opcode INST"),
        (b"\x80\x02\x82\x01.", "opcode EXT1"),
        (b"\x80\x02(cos\nsystem\no.", "opcode OBJ"),
        (b"\x80\x05\x96" + b"\xff" * 7 + b"\x0f.", "BYTEARRAY8|bytes in a"),
        (b"\x80\x02}r\xff\xff\xff\x7f.", "memo"),
        (b"\x80\x02ctorch\nFloatStorage\n)R.", "not callable"),
        # BUILD must not change these classes, nor what is made of them.
        (BUILT % b"ctorch._utils\n_rebuild_tensor\n", "missing .*required"),
        (BUILT % b"ctorch.nn.parameter\nParameter\n", "missing .*required"),
        (BUILT % b"ctorch\nFloatStorage\n", "has no attribute"),
        (BUILT % b"}", "has no attribute"),
        (BUILT % b"ccollections\nOrderedDict\n)R", "no tensor a"),
        (b"\x80\x02h\x05.", "Memo value not found"),
        (b"\x80\x02R.", "underflow"),
        (b"\x80\x02((.", "MARK"),
        (b"\x80\x02.", "underflow|empty"),
        (b"\x80\x02K\x01Q.", "cannot unpack"),
        (b"\x80\x02ccollections\nOrderedDict\nK\x01\x85R.", "not iterable"),
        (b"\x80\x02K\x01.", "no dict of tensors"),
        (b"\x80\x02\xff.", "opcode"),
        (b"\x80\x02" + b")" * (1 << 17), "exhausted"),
        (b"\x80\x02})" + b"\x85" * 32000 + b"K\x01s.", "no tensor a"),
    ],
)
def test_other_pickles_are_refused_in_one_line(read, program, reason):
    with pytest.raises(ValueError, match=reason) as caught:
        read(torch_writer.head() + program + pickle.dumps([], 2))
    assert "net.pth" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not isinstance(torch_files.Tensor.__setstate__, int)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"offset": 2}, "beyond its storage"),
        ({"offset": -1}, "out of range"),
        ({"stride": 4}, "beyond its storage"),
        ({"stride": -1}, "out of range"),
        ({"stride": 0, "rows": 10}, "instead of"),
        ({"rows": 1 << 62}, "instead of"),
        ({"rows": 1 << 64}, "out of range"),
        ({"count": 8}, "not as long"),
        ({"count": 1 << 60}, "not as long"),
        ({"count": -7}, "out of range"),
    ],
)
def test_a_view_beyond_its_storage_is_refused(read, change, reason):
    content = (
        torch_writer.head() + torch_writer.changed(**change) + pickle.dumps(["12"], 2)
    )
    content += (7).to_bytes(8, "little") + bytes(28)
    with pytest.raises(ValueError, match=rf"net\.pth: .*{reason}"):
        read(content, {"a": (2, 3)})


def test_a_view_that_repeats_is_refused(read):
    content = (
        torch_writer.head()
        + torch_writer.changed(stride=0, rows=9)
        + pickle.dumps(["12"], 2)
    )
    content += (7).to_bytes(8, "little") + bytes(28)
    with pytest.raises(ValueError, match="beyond its storage"):
        read(content, {"a": (9, 3)})


@pytest.mark.parametrize("share", [0, 0.1, 0.5, 0.9, 0.999])
def test_a_file_cut_short_is_named(arrays, read, written, share):
    content = written(torch_writer.state_dict(arrays))
    with pytest.raises(ValueError, match=r"net\.pth: "):
        read(content[: int(share * len(content))])


def test_a_count_that_promises_more_than_the_file_has(read):
    content = (
        torch_writer.head()
        + torch_writer.changed(count=1 << 40)
        + pickle.dumps(["12"], 2)
    )
    content += (1 << 40).to_bytes(8, "little")
    with pytest.raises(ValueError, match="cut short"):
        read(content + bytes(28), {"a": (2, 3)})


@pytest.mark.parametrize(
    "keys", [["13"], [], ["12", "12"], "12", [12], [["12"]], ["12", "13"]]
)
def test_storages_that_belong_to_no_tensor(read, keys):
    content = torch_writer.head() + torch_writer.old() + pickle.dumps(keys, 2)
    with pytest.raises(ValueError, match="its storages are not"):
        read(content + (7).to_bytes(8, "little") + bytes(28), {"a": (2, 3)})


def test_big_endian_files_are_refused(arrays, read):
    state = torch_writer.state_dict(arrays)
    system = torch_writer.SYSTEM | {"little_endian": False}
    for content in (
        torch_writer.legacy(state, system=system),
        torch_writer.zipped(state, order=b"big"),
    ):
        with pytest.raises(ValueError, match="little-endian"):
            read(content)


def test_members_of_an_archive_are_stored_and_inside(arrays, read, tmp_path):
    state = torch_writer.state_dict(arrays)
    with pytest.raises(ValueError, match="compressed"):
        read(torch_writer.zipped(state, compression=zipfile.ZIP_DEFLATED))
    state["a.bias"].key = "../../9"
    with pytest.raises(ValueError, match="no storage"):
        read(torch_writer.zipped(state))
    state["a.bias"].key = "9001"
    with pytest.warns(UserWarning, match="Duplicate name"):
        content = torch_writer.zipped(state)
    with pytest.raises(ValueError, match=r"larger|cut short"):
        read(content)
    assert [path.name for path in tmp_path.iterdir()] == ["net.pth"]


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


def test_altered_bytes_are_an_error_or_change_numbers_only(arrays, read, written, rng):
    content = np.frombuffer(written(torch_writer.state_dict(arrays)), np.uint8)
    refused = 0
    for _ in range(1000):
        altered = content.copy()
        places = rng.integers(0, len(content), 3)
        altered[places] = rng.integers(0, 256, 3)
        try:
            found = read(altered.tobytes())
        except ValueError:
            refused += 1
        else:
            assert {k: v.shape for k, v in found.items()} == SHAPES
    assert 0 < refused < 1000
