"""mip-NeRF 360's scenes: fetched on from where it stopped, checked, unpacked."""

import contextlib
import hashlib
import http.server
import io
import shutil
import threading
import zipfile

import pytest

from alignerf.experiment.checks import fetched
from alignerf.scenes import download

NAME, CURL = "360_v2.zip", download.CURL


def archive_of(files, kind):
    """Bytes of a ZIP with these files."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", kind) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return made.getvalue()


@pytest.fixture
def bucket(monkeypatch):
    """Serve an archive of these files; list what is asked for, as a Range."""
    asked = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            wanted = self.headers.get("Range")
            asked.append(wanted)
            content = self.server.content
            first = int(wanted[6:-1]) if wanted else 0
            if first >= len(content):
                self.send_error(416)
                return
            self.send_response(206 if wanted else 200)
            self.send_header("Content-Length", str(len(content) - first))
            if wanted:
                places = f"bytes {first}-{len(content) - 1}/{len(content)}"
                self.send_header("Content-Range", places)
            self.end_headers()
            self.wfile.write(content[first:][: self.server.most])

        def log_message(self, *_):
            pass

    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()

        def serve(files, kind=zipfile.ZIP_STORED, most=None, md5=""):
            content = server.content = archive_of(files, kind)
            server.most = most
            if md5 is not None:
                md5 = md5 or hashlib.md5(content, usedforsecurity=False).hexdigest()
            monkeypatch.setitem(download.ARCHIVES, NAME, (len(content), md5))
            monkeypatch.setitem(fetched.ARCHIVES, NAME, ("bicycle",))
            monkeypatch.setattr(download, "CURL", CURL.replace("=https", "=http"))
            address = f"http://127.0.0.1:{server.server_port}"
            monkeypatch.setattr(download, "BUCKET", address)
            return content, asked

        yield serve
        server.shutdown()


def test_scenes_are_fetched_and_the_archive_goes(bucket, tmp_path, capsys):
    files = {"bicycle/images_4/a.JPG": b"photo", "bicycle/sparse/0/cameras.bin": b"c"}
    bucket(files | {"flowers.txt": b"not yet"})
    out = tmp_path / "360_v2"
    download.main([str(out / "bicycle")])
    found = {str(p.relative_to(out)): p.read_bytes() for p in out.rglob("*.*")}
    assert found == files
    assert "no licence is published" in capsys.readouterr().out


def test_nothing_is_appended_through_a_link(bucket, tmp_path):
    bucket({"bicycle/a": b"a"})
    (tmp_path / "mine").write_bytes(b"mine")
    (tmp_path / "360_v2.zip.fetched").symlink_to(tmp_path / "mine")
    with pytest.raises(ValueError, match="fetched: a link"):
        download.main([str(tmp_path / "bicycle")])
    assert (tmp_path / "mine").read_bytes() == b"mine"


def test_what_is_there_is_left_alone(bucket, tmp_path):
    _, asked = bucket({"bicycle/a": b"theirs"})
    (tmp_path / "bicycle").mkdir()
    download.main([str(tmp_path / "bicycle")])
    assert asked == []
    assert not list((tmp_path / "bicycle").iterdir())


def test_an_archive_by_other_means_is_taken(bucket, tmp_path, monkeypatch):
    content, _ = bucket({"bicycle/a": b"a"})
    monkeypatch.setattr(download, "BUCKET", "http://127.0.0.1:9")
    with pytest.raises(
        ValueError, match=r"zip: .*: the same command .* put it to .*zip$"
    ):
        download.main([str(tmp_path / "bicycle")])
    (tmp_path / "360_v2.zip").write_bytes(content)
    download.main([str(tmp_path / "bicycle")])
    assert (tmp_path / "bicycle/a").read_bytes() == b"a"
    # A user's own archive stays as it is, also where it is another, or half of it.
    assert (tmp_path / "360_v2.zip").read_bytes() == content
    (tmp_path / "360_v2.zip").write_bytes(content[:-9])
    shutil.rmtree(tmp_path / "bicycle")
    with pytest.raises(ValueError, match="delete it"):
        download.main([str(tmp_path / "bicycle")])
    assert (tmp_path / "360_v2.zip").read_bytes() == content[:-9]


@pytest.mark.parametrize(
    ("files", "change", "reason"),
    [
        ({"bicycle/a": b"a"}, {"md5": "0" * 32}, "not as published: delete it"),
        ({"garden/a": b"a"}, {}, "no scene bicycle"),
    ],
)
def test_a_wrong_archive_makes_nothing(bucket, tmp_path, files, change, reason):
    bucket(files, **change)
    out = tmp_path / "360_v2"
    with pytest.raises(ValueError, match=reason):
        download.main([str(out / "bicycle")])
    left = [path.name for path in tmp_path.rglob("*")]
    assert left == ["360_v2", "360_v2.zip.fetched"]


def test_nothing_is_unpacked_outside(bucket, tmp_path):
    bucket({"bicycle/../../../a": b"a", "/bicycle/b": b"b", "../bicycle/c": b"c"})
    out = tmp_path / "in" / "360_v2"
    download.main([str(out / "bicycle")])
    found = [str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()]
    assert found == ["in/360_v2/bicycle/a"]


@pytest.mark.parametrize("kind", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_a_damaged_archive_is_named(bucket, tmp_path, kind):
    content, _ = bucket({"bicycle/a": bytes(1000) + b"whole photo"}, kind, md5=None)
    damaged = bytearray(content)
    damaged[45] ^= 255
    (tmp_path / "360_v2.zip").write_bytes(damaged)
    with pytest.raises(ValueError, match=r"360_v2\.zip: .*: delete it, and run"):
        download.main([str(tmp_path / "bicycle")])
    assert not (tmp_path / "bicycle").exists()


def test_a_dropped_connection_goes_on_the_next_time(bucket, tmp_path):
    content, asked = bucket({"bicycle/a": bytes(5000)}, most=2000)
    with pytest.raises(ValueError, match=r"360_v2\.zip: .*: the same command"):
        download.main([str(tmp_path / "bicycle")])
    while not (tmp_path / "bicycle").exists():
        with contextlib.suppress(ValueError):
            download.main([str(tmp_path / "bicycle")])
    assert asked[:3] == [None, "bytes=2000-", "bytes=4000-"]
    # A whole one is not asked for again.
    (tmp_path / "360_v2.zip").write_bytes(content)
    download.main([str(tmp_path / "bicycle")])
    assert len(asked) == 3


def test_http_is_not_followed(bucket, tmp_path, monkeypatch):
    _, asked = bucket({"bicycle/a": b"a"})
    monkeypatch.setattr(download, "CURL", CURL)
    with pytest.raises(ValueError, match=r"360_v2\.zip: .*: the same command"):
        download.main([str(tmp_path / "bicycle")])
    assert asked == []


def test_the_archive_stays_for_scenes_that_are_missing(bucket, tmp_path, monkeypatch):
    bucket({"bicycle/a": b"a", "garden/a": b"a"})
    monkeypatch.setitem(fetched.ARCHIVES, "360_v2.zip", ("bicycle", "garden"))
    for name, left in (("bicycle", True), ("garden", False)):
        download.main([str(tmp_path / name)])
        assert (tmp_path / "360_v2.zip.fetched").exists() == left
    with pytest.raises(ValueError, match="oak is no scene of mip-NeRF 360"):
        download.main([str(tmp_path / "oak")])


def test_the_papers_five_scenes_are_among_them():
    papers = {"bicycle", "flowers", "garden", "stump", "treehill"}
    assert papers < {name for names in fetched.ARCHIVES.values() for name in names}
    assert download.ARCHIVES.keys() == fetched.ARCHIVES.keys()
    assert download.BUCKET.startswith("https://")
