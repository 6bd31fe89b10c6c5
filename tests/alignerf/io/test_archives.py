"""Both packages' reading of .npz: a header that numpy stumbles over is named."""

import resource
import zipfile

import numpy as np
import pytest

from alignerf.io import archives
from flow.warping import files
from tools.torture import damage

READ = {
    "alignerf": lambda path: archives.read(path, ["flow_px", "valid"]),
    "flow": files.read_flow,
}


def header(text):
    """The start of a .npy of version 1 with this header."""
    text = text.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


@pytest.mark.parametrize("read", READ.values(), ids=READ)
@pytest.mark.parametrize("shape", ["(3, 17", f"({10**30}, 17), }}", f"({10**15},), }}"])
def test_a_header_that_means_nothing_is_named(tmp_path, shape, read):
    path = tmp_path / "view.npz"
    start = header("{'descr': '<f8', 'fortran_order': False, 'shape': " + shape)
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("flow_px", "valid"):
            archive.writestr(f"{name}.npy", start + bytes(64))
    with pytest.raises(ValueError, match=r"view\.npz: not "):
        read(path)


@pytest.fixture
def flow_path(tmp_path):
    path = tmp_path / "view.npz"
    valid = np.ones((3, 4), bool)
    np.savez(path, flow_px=np.zeros((3, 4, 2), np.float32), valid=valid)
    return path


@pytest.mark.whole
def test_a_zip_bomb_is_refused_by_its_head(flow_path, rng):
    damage.NPZ_WAYS["a zip bomb"](flow_path, rng)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for read in READ.values():
        with pytest.raises(ValueError, match=r"view\.npz: not .*"):
            read(flow_path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**18


@pytest.mark.parametrize("read", READ.values(), ids=READ)
def test_an_encrypted_archive_is_named(flow_path, read, rng):
    damage.NPZ_WAYS["encrypted"](flow_path, rng)
    with pytest.raises(ValueError, match=r"view\.npz: .*encrypted"):
        read(flow_path)


def test_objects_are_refused(flow_path):
    np.savez(flow_path, valid=np.array([{}]))
    with pytest.raises(ValueError, match=r"view\.npz: .*objects"):
        archives.read(flow_path, ["valid"])


def test_an_npy_longer_than_it_says_is_refused(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.zeros(4))
    assert archives.read_numbers(path).tolist() == [0, 0, 0, 0]
    with open(path, "ab") as file:
        file.write(bytes(8))
    with pytest.raises(ValueError, match=r"a\.npy: .*more bytes than its head"):
        archives.read_numbers(path)


def test_a_damaged_archive_of_any_compression_is_named(tmp_path, rng):
    """Its decoders raise errors of their own."""
    for method in (zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2, zipfile.ZIP_DEFLATED):
        path = tmp_path / "view.npz"
        with zipfile.ZipFile(path, "w", method) as archive:
            archive.writestr(
                "valid.npy", header("{'descr': '|b1', 'x': 1}") + bytes(999)
            )
        content = bytearray(path.read_bytes())
        content[45:60] = rng.bytes(15)
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"view\.npz: not the \.npz"):
            archives.read(path, ["valid"])
