"""mip-NeRF 360's scenes: fetched on from where it stopped, checked, unpacked."""

import hashlib
import http.server
import io
import threading
import zipfile

import pytest

from alignerf.experiment.checks import fetched
from alignerf.io import downloads
from alignerf.scenes import download


def archive_of(files):
    """Bytes of a ZIP with these files."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
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
            self.end_headers()
            self.wfile.write(content[first:])

        def log_message(self, *_):
            pass

    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()

        def serve(files, **change):
            server.content = archive_of(files)
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
    download.main([str(out)])
    found = {str(p.relative_to(out)): p.read_bytes() for p in out.rglob("*.*")}
    assert found == files
    assert "no licence is published" in capsys.readouterr().out


def test_a_stopped_download_goes_on(bucket, tmp_path):
    content, asked = bucket({"bicycle/a": bytes(range(256)) * 99})
    (tmp_path / "360_v2.zip").write_bytes(content[:1000])
    download.main([str(tmp_path)])
    assert asked == ["bytes=1000-"]
    assert (tmp_path / "bicycle/a").read_bytes() == bytes(range(256)) * 99


def test_what_is_there_is_left_alone(bucket, tmp_path):
    _, asked = bucket({"bicycle/a": b"theirs"})
    (tmp_path / "bicycle").mkdir()
    download.main([str(tmp_path)])
    assert asked == []
    assert not list((tmp_path / "bicycle").iterdir())


def test_an_archive_by_other_means_is_taken(bucket, tmp_path, monkeypatch):
    content, _ = bucket({"bicycle/a": b"a"})
    nowhere = download.ARCHIVES[0]._replace(url="http://127.0.0.1:9/360_v2.zip")
    monkeypatch.setattr(download, "ARCHIVES", [nowhere])
    with pytest.raises(ValueError, match=r"put it to .*360_v2\.zip, or its scenes"):
        download.main([str(tmp_path)])
    (tmp_path / "360_v2.zip").write_bytes(content)
    download.main([str(tmp_path)])
    assert (tmp_path / "bicycle/a").read_bytes() == b"a"


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
        download.main([str(out)])
    assert [path.name for path in tmp_path.rglob("*")] == ["360_v2", "360_v2.zip"]


def test_nothing_is_unpacked_outside(bucket, tmp_path):
    bucket({"bicycle/../../../a": b"a", "/bicycle/b": b"b", "../bicycle/c": b"c"})
    out = tmp_path / "in" / "360_v2"
    download.main([str(out)])
    found = [str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()]
    assert found == ["in/360_v2/bicycle/a"]


def test_a_damaged_photo_is_named(bucket, tmp_path):
    content, _ = bucket({"bicycle/a": b"whole photo"}, hash=None)
    damaged = content.replace(b"whole photo", b"whole ph0to", 1)
    (tmp_path / "360_v2.zip").write_bytes(damaged)
    with pytest.raises(ValueError, match=r"Bad CRC-32 .*: delete it"):
        download.main([str(tmp_path)])
    assert not (tmp_path / "bicycle").exists()


def test_the_papers_five_scenes_are_among_them():
    papers = {"bicycle", "flowers", "garden", "stump", "treehill"}
    assert papers < {name for names in fetched.ARCHIVES.values() for name in names}
    for published in download.ARCHIVES:
        assert published.url.startswith("https://")
        assert fetched.ARCHIVES[published.name]
