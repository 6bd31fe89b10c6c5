"""mip-NeRF 360's scenes: fetched on from where it stopped, checked, unpacked."""

import contextlib
import errno
import hashlib
import http.server
import io
import shutil
import threading
import urllib.error
import urllib.request
import zipfile
from unittest import mock

import pytest

from alignerf.experiment.checks import fetched
from alignerf.io import downloads
from alignerf.scenes import download


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
            if self.server.elsewhere:
                self.send_response(302)
                self.send_header("Location", self.server.elsewhere)
                self.end_headers()
                return
            content = self.server.content
            first = int(wanted[6:-1]) if wanted else 0
            if first >= len(content):
                self.send_error(416)
                return
            self.send_response(206 if wanted else 200)
            self.end_headers()
            self.wfile.write(content[first:][: self.server.most])

        def log_message(self, *_):
            pass

    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()

        def serve(files, kind=zipfile.ZIP_STORED, most=None, elsewhere="", **change):
            server.content, server.most = archive_of(files, kind), most
            server.elsewhere = elsewhere
            published = downloads.Published(
                f"http://127.0.0.1:{server.server_port}/360_v2.zip",
                len(server.content),
                hashlib.md5(server.content, usedforsecurity=False).hexdigest(),
                "md5",
            )._replace(**change)
            monkeypatch.setattr(download, "ARCHIVES", [published])
            monkeypatch.setitem(fetched.ARCHIVES, published.name, ("bicycle",))
            return server.content, asked

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


def test_a_stopped_download_goes_on(bucket, tmp_path):
    content, asked = bucket({"bicycle/a": bytes(range(256)) * 99})
    (tmp_path / "360_v2.zip.fetched").write_bytes(content[:1000])
    download.main([str(tmp_path / "bicycle")])
    assert asked == ["bytes=1000-"]
    assert (tmp_path / "bicycle/a").read_bytes() == bytes(range(256)) * 99


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
    nowhere = download.ARCHIVES[0]._replace(url="http://127.0.0.1:9/360_v2.zip")
    monkeypatch.setattr(download, "ARCHIVES", [nowhere])
    with pytest.raises(ValueError, match=r"put it to .*360_v2\.zip, or the scene"):
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
        ({"bicycle/a": b"a"}, {"hash": "0" * 32}, "its MD5 is .*: delete it"),
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
    content, _ = bucket({"bicycle/a": bytes(1000) + b"whole photo"}, kind, hash=None)
    damaged = bytearray(content)
    damaged[45] ^= 255
    (tmp_path / "360_v2.zip").write_bytes(damaged)
    with pytest.raises(ValueError, match=r"360_v2\.zip: .*: delete it, and run"):
        download.main([str(tmp_path / "bicycle")])
    assert not (tmp_path / "bicycle").exists()


def test_a_dropped_connection_goes_on_the_next_time(bucket, tmp_path):
    content, asked = bucket({"bicycle/a": bytes(5000)}, most=2000)
    with pytest.raises(ValueError, match=r"2000 of \d+ bytes came: the same command"):
        download.main([str(tmp_path / "bicycle")])
    while not (tmp_path / "bicycle").exists():
        with contextlib.suppress(ValueError):
            download.main([str(tmp_path / "bicycle")])
    assert asked[:3] == [None, "bytes=2000-", "bytes=4000-"]
    # A whole one is not asked for again.
    (tmp_path / "360_v2.zip").write_bytes(content)
    download.main([str(tmp_path / "bicycle")])
    assert len(asked) == 3


def test_a_full_disk_is_not_the_servers_fault(bucket, tmp_path, monkeypatch):
    bucket({"bicycle/a": b"a"})
    full = OSError(errno.ENOSPC, "No space left on device")
    monkeypatch.setattr("builtins.open", mock.Mock(side_effect=full))
    with pytest.raises(OSError, match=r"No space left .*360_v2\.zip"):
        download.main([str(tmp_path / "bicycle")])


@pytest.mark.parametrize("first", ["http", "https"])
@pytest.mark.parametrize("then", ["http", "https", "HTTPS", "ftp", "file"])
def test_no_redirect_leaves_the_kind_of_address(bucket, tmp_path, first, then):
    elsewhere = f"{then}://127.0.0.1:9/360_v2.zip"
    goes_on = first == then.lower()
    asked = urllib.request.Request(f"{first}://here/360_v2.zip")
    refused = pytest.raises(urllib.error.URLError, match="redirected to")
    with contextlib.nullcontext() if goes_on else refused:
        downloads.Redirect().redirect_request(asked, None, 302, "", {}, elsewhere)
    if first == "http" and then != "http":
        bucket({"bicycle/a": b"a"}, elsewhere=elsewhere)
        with pytest.raises(ValueError, match=r"360_v2\.zip: .*: the same command"):
            download.main([str(tmp_path / "bicycle")])
        assert not any(tmp_path.iterdir())


def test_without_a_hash_the_first_archive_is_the_one(bucket, tmp_path):
    scene = tmp_path / "bicycle"
    for content in (b"first", b"first", b"other"):
        bucket({"bicycle/a": content}, hash=None)
        wrong = pytest.raises(ValueError, match=r"its SHA256 is .*: delete it")
        with wrong if content == b"other" else contextlib.nullcontext():
            download.main([str(scene)])
            shutil.rmtree(scene)
    assert not scene.exists()


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
    for published in download.ARCHIVES:
        assert published.url.startswith("https://")
        assert fetched.ARCHIVES[published.name]
