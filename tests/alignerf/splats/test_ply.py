"""Every program's .ply gives the same Gaussians, and what is none is one clear line."""

import types

import numpy as np
import pytest

from alignerf.splats import ply, rows
from tests.splat_cases import COUNT, NAMES, columns, write, write_packed


def check(found, table, *, kept=slice(None), rtol=1e-6):
    """The activations of 3DGS, of a table's columns."""
    stacked = {n: np.stack([table[m] for m in of], -1)[kept] for n, of in NAMES.items()}
    wanted = dict(stacked)
    wanted["scales"] = np.exp(stacked["scales"])
    wanted["opacities"] = 1 / (1 + np.exp(-stacked["opacities"][:, 0]))
    length = np.linalg.norm(stacked["quaternions"], axis=1, keepdims=True)
    wanted["quaternions"] = stacked["quaternions"] / length
    per_channel = sum(name.startswith("f_rest_") for name in table) // 3
    wanted["sh"] = np.empty((len(length), 1 + per_channel, 3))
    for channel in range(3):
        wanted["sh"][:, 0, channel] = wanted["dc"][:, channel]
        for i in range(per_channel):
            own = table[f"f_rest_{per_channel * channel + i}"][kept]
            wanted["sh"][:, 1 + i, channel] = own
    for name in ("means", "scales", "quaternions", "opacities", "sh"):
        array = getattr(found, name)
        assert array.dtype == np.float32
        np.testing.assert_allclose(array, wanted[name], rtol=rtol, atol=1e-6)


@pytest.mark.parametrize("rest", [0, 9, 24, 45])
@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_3dgs(rng, tmp_path, rest, encoding):
    """Its normals, which are nothing, and columns of others are passed over."""
    table = columns(rng, rest=rest)
    table |= {"nx": 0 * table["x"], "confidence": table["x"]}
    found = ply.read(write(tmp_path / "a.ply", table, encoding=encoding))
    check(found, table)
    assert found.antialiased is None


def test_doubles_of_the_other_byte_order_after_another_element(rng, tmp_path):
    table = columns(rng)
    path = write(tmp_path / "a.ply", table, kind="f8", encoding="binary_big_endian")
    head, _, rows = path.read_bytes().partition(b"end_header\n")
    first = b"element camera 2\nproperty uchar a\nproperty ushort b\nelement vertex"
    head = head.replace(b"element vertex", first).replace(b"\n", b"\r\n")
    path.write_bytes(head + b"end_header\r\n" + b"abcdef" + rows)
    check(ply.read(path), table)


def test_many_blocks(rng, tmp_path):
    table = columns(rng, rest=0, count=20_000)
    check(ply.read(write(tmp_path / "a.ply", table)), table)


@pytest.mark.parametrize(
    ("comment", "antialiased", "dilation_px2"),
    [
        ("SplatRenderMode: mip", True, 0.1),
        ("SplatRenderMode: default", False, 0.3),
        ("antialiased 1", True, 0.3),
        ("Exported from Brush", None, 0.3),
    ],
)
def test_what_a_comment_says_of_the_filter(
    rng, tmp_path, comment, antialiased, dilation_px2
):
    table = columns(rng, rest=0)
    found = ply.read(write(tmp_path / "a.ply", table, comments=["by me", comment]))
    assert (found.antialiased, found.dilation_px2) == (antialiased, dilation_px2)


def test_the_3d_filter_of_mip_splatting(rng, tmp_path):
    table = columns(rng, rest=0)
    plain = ply.read(write(tmp_path / "a.ply", table))
    size = table["filter_3D"] = rng.uniform(0.1, 1, COUNT)
    found = ply.read(write(tmp_path / "b.ply", table))
    assert (found.antialiased, found.dilation_px2) == (True, 0.1)
    wide = plain.scales**2 + size[:, None] ** 2
    np.testing.assert_allclose(found.scales**2, wide, rtol=1e-5)
    share = np.sqrt(np.prod(plain.scales**2, axis=1) / np.prod(wide, axis=1))
    np.testing.assert_allclose(found.opacities, plain.opacities * share, rtol=1e-5)


def test_numbers_that_are_none_are_left_out(rng, tmp_path, caplog):
    table = columns(rng)
    table["x"][3], table["f_rest_7"][9] = np.nan, np.inf
    # Of a scale of e^100 too; a logit of infinity is an opacity of 1.
    table["scale_1"][11], table["opacity"][12] = 100, np.inf
    path = write(tmp_path / "a.ply", table)
    found = ply.read(path)
    kept = np.delete(np.arange(COUNT), [3, 9, 11])
    with np.errstate(over="ignore"):
        check(found, table, kept=kept)
    (line,) = (record.getMessage() for record in caplog.records)
    told = f"{path}: 3 of 300 Gaussians hold NaN or infinity and are left out"
    assert line == told


def test_a_quaternion_of_no_length_turns_nothing(rng, tmp_path):
    table = columns(rng, rest=0)
    for name in NAMES["quaternions"]:
        table[name][5] = 0
    found = ply.read(write(tmp_path / "a.ply", table))
    np.testing.assert_array_equal(found.quaternions[5], [1, 0, 0, 0])


@pytest.mark.parametrize("degree", [0, 1, 3])
@pytest.mark.parametrize("has_colours", [False, True])
def test_packed_numbers_are_unpacked(rng, tmp_path, degree, has_colours):
    count = 9000
    wanted = types.SimpleNamespace(
        means=rng.uniform(-1, 1, (count, 3)),
        scales=np.exp(rng.uniform(-6, -2, (count, 3))),
        quaternions=ply.normalized(rng.normal(size=(count, 4))),
        opacities=rng.uniform(0, 1, count),
        sh=rng.uniform(-1.7, 1.7, (count, (degree + 1) ** 2, 3)),
    )
    path = write_packed(tmp_path / "a.ply", wanted, has_colours=has_colours)
    found = ply.read(path)
    np.testing.assert_allclose(found.means, wanted.means, atol=2e-3)
    np.testing.assert_allclose(found.scales, wanted.scales, rtol=4e-3)
    np.testing.assert_allclose(found.opacities, wanted.opacities, atol=2e-3)
    np.testing.assert_allclose(found.sh, wanted.sh, atol=0.02)
    same = np.abs(np.sum(found.quaternions * wanted.quaternions, axis=1))
    np.testing.assert_allclose(same, 1, atol=2e-6)
    content = path.read_bytes()
    path.write_bytes(content[:-1])
    with pytest.raises(ValueError, match="cut off"):
        ply.read(path)
    path.write_bytes(content.replace(b"element chunk 36", b"element chunk 35"))
    with pytest.raises(ValueError, match="35 chunks of 9,000 Gaussians"):
        ply.read(path)


def test_packed_numbers_of_another_type_are_one_line(rng, tmp_path):
    """Each property as each other type, as a list, missing, twice."""
    wanted = types.SimpleNamespace(
        means=rng.normal(size=(COUNT, 3)),
        scales=rng.uniform(1, 2, (COUNT, 3)),
        quaternions=ply.normalized(rng.normal(size=(COUNT, 4))),
        opacities=rng.uniform(0, 1, COUNT),
        sh=rng.uniform(-1, 1, (COUNT, 4, 3)),
    )
    path = write_packed(tmp_path / "a.ply", wanted)
    head, end, numbers = path.read_bytes().partition(b"end_header\n")
    lines = head.decode().splitlines()
    for i, line in enumerate(lines):
        if not line.startswith("property"):
            continue
        _, kind, name = line.split()
        others = {k for k in rows.TYPES if rows.TYPES[k] != rows.TYPES[kind]}
        changed = {f"property {one} {name}" for one in {*others, "list uchar float"}}
        for new in [*changed, "", f"property {kind} other", f"{line}\n{line}"]:
            told = "\n".join([*lines[:i], new, *lines[i + 1 :], ""])
            # None is refused because numbers are missing.
            path.write_bytes(told.encode() + end + numbers + bytes(8 * COUNT))
            with pytest.raises(ValueError, match=name) as fault:
                ply.read(path)
            assert str(fault.value).startswith(f"{path}: ")


def without(name):
    return lambda table: {k: v for k, v in table.items() if k != name}


@pytest.mark.parametrize(
    ("change", "options", "said"),
    [
        (lambda t: {n: t[n] for n in "xyz"}, {}, "points, not a splat: .* no f_dc_0"),
        (
            lambda t: {n: t[n] for n in "xyz"},
            {"more": "element face 1\nproperty list uchar int vertex_indices\n"},
            "a mesh, not a splat",
        ),
        (without("scale_2"), {}, "2DGS"),
        (without("f_rest_4"), {}, "44 properties f_rest"),
        (lambda t: t | {f"f_rest_{i}": t["x"] for i in range(72)}, {}, "25 coeff"),
        (lambda t: {n: v[:0] for n, v in t.items()}, {}, "without Gaussians"),
        (lambda t: {n: v * np.nan for n, v in t.items()}, {}, "all of its 300 "),
    ],
)
def test_what_is_no_splat_is_one_line(rng, tmp_path, change, options, said):
    path = write(tmp_path / "a.ply", change(columns(rng)), **options)
    with pytest.raises(ValueError, match=said) as fault:
        ply.read(path)
    assert str(fault.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (b"ply\n", b"plx\n", "not a .ply"),
        (b"end_header", b"end_heade", "header has no end"),
        (b"vertex 300", b"vertex -3", "'element vertex -3' in its header"),
        (b"vertex 300", b"vertex 3e2", "'element vertex 3e2'"),
        (b"vertex 300", b"vertex 301", "cut off: 7.,... bytes of at least 7.,..."),
        (b"vertex 300", b"vertex 999999999999999", "cut off"),
        (b"vertex 300", b"vertex 1000000000000000000000", "in its header"),
        (b"element vertex", b"element vertices", "not a splat"),
        (b"float x\n", b"real x\n", "'property real x'"),
        (b"float x\n", b"float y\n", "occurs more than once"),
        (b"format", b"comment", "in its header|names no format"),
        (b"1.0\n", b"1.0\nelement a 9\nproperty list uchar int b\n", "lists of 'a'"),
    ],
)
def test_a_header_that_cannot_be_is_one_line(rng, tmp_path, old, new, said):
    path = write(tmp_path / "a.ply", columns(rng))
    path.write_bytes(path.read_bytes().replace(old, new, 1))
    with pytest.raises(ValueError, match=said) as fault:
        ply.read(path)
    assert str(fault.value).startswith(f"{path}: ")


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
@pytest.mark.parametrize("share", [0, 0.001, 0.05, 0.5, 0.999])
def test_a_file_that_is_cut_off_is_one_line(rng, tmp_path, encoding, share):
    path = write(tmp_path / "a.ply", columns(rng), encoding=encoding)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(ValueError, match=r"cut off|no end|not a \.ply|numbers where"):
        ply.read(path)


@pytest.mark.parametrize("word", [b"wo rd", b"1_000"])
def test_text_that_is_no_number_is_one_line(rng, tmp_path, word):
    path = write(tmp_path / "a.ply", columns(rng, rest=0), encoding="ascii")
    path.write_bytes(path.read_bytes()[:-5] + word)
    with pytest.raises(ValueError, match=r"a\.ply: "):
        ply.read(path)


def test_what_no_memory_holds_is_said_before_it_is_read(rng, tmp_path, monkeypatch):
    free = types.SimpleNamespace(available=30_000)
    monkeypatch.setattr(ply.psutil, "virtual_memory", lambda: free)
    path = write(tmp_path / "a.ply", columns(rng))
    with pytest.raises(ValueError, match=r"300 Gaussians take .* GiB of memory, and"):
        ply.read(path)
