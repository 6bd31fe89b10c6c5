"""Both packages' reading of .npz: a header that numpy stumbles over is named."""

import zipfile

import pytest

from alignerf.command import archives
from flow.warping import files

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
