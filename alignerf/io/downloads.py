"""Published files, fetched by HTTPS and checked; a stopped download goes on."""

import contextlib
import hashlib
import http.client
import os
import ssl
import urllib.error
import urllib.request
from pathlib import Path
from typing import NamedTuple

from alignerf.io import atomic, faults, progress

BLOCK_BYTES = 1 << 20
TIMEOUT_S = 60
PARTIAL = 206
# Errors of the system that are the connection's, and not the disk's.
OF_THE_NET = (urllib.error.URLError, ssl.SSLError, ConnectionError, TimeoutError)


class Published(NamedTuple):
    """A file as published: where, how many bytes, and its hash, if there is one.

    kind: of the hash, as `hashlib` calls it.
    """

    url: str
    size: int
    hash: str | None
    kind: str = "sha256"

    @property
    def name(self):
        return self.url.rsplit("/", 1)[1]


def check(path, published):
    """Raise ValueError where a file has not the published one's size or hash."""
    with faults.opened(path) as file:
        size = Path(path).stat().st_size
        if size != published.size:
            found, wanted = f"it has {size} bytes", f"{published.size}"
        else:
            kind = published.kind
            made = published.hash and hashlib.file_digest(file, kind).hexdigest()
            found, wanted = f"its {kind.upper()} is {made}", published.hash
            if made == wanted:
                return
    raise ValueError(f"{path}: not {published.url}: {found} instead of {wanted}")


def fetch(published, folder):
    """Path of a published file in a folder, fetched as far as it is not there yet.

    A file of its name is a user's. What is fetched is called NAME.fetched, which its
    caller may remove. Raises ValueError where the server, or the way to it, fails; what
    has come stays.
    """
    path = Path(folder) / published.name
    if os.path.lexists(path):
        return path
    path = path.with_name(f"{path.name}.fetched")
    if path.is_symlink():
        raise ValueError(f"{path}: a link, and nothing is written through one")
    done = path.stat().st_size if path.exists() else 0
    if done and done >= published.size:
        return path
    try:
        with opened(published.url, done) as answer:
            done = done if answer.status == PARTIAL else 0
            done = write(answer, path, done, published)
    except (*OF_THE_NET, http.client.HTTPException) as error:
        raise ValueError(f"{published.url}: {error}") from None
    if done < published.size:
        came = f"{done} of {published.size} bytes came"
        raise ValueError(f"{published.url}: {came}")
    return path


def write(answer, path, done, published):
    """Write what an answer holds behind the `done` bytes of a file; returns its size.

    A block more than there should be is enough to know.
    """
    blocks = -(-published.size // BLOCK_BYTES)
    begun = done // BLOCK_BYTES
    shown = progress.Progress(published.name, blocks, done=begun, unit="MB")
    with (
        contextlib.closing(shown),
        atomic.naming(path),
        open(path, "ab" if done else "wb") as file,
    ):
        while done <= published.size and (block := answer.read(BLOCK_BYTES)):
            file.write(block)
            done += len(block)
            shown.advance()
    return done


def opened(url, done):
    """The answer of a server that is asked for what follows `done` bytes."""
    request = urllib.request.Request(url)
    if done:
        request.add_header("Range", f"bytes={done}-")
    return urllib.request.build_opener(Redirect).open(request, timeout=TIMEOUT_S)


class Redirect(urllib.request.HTTPRedirectHandler):
    """Goes on to another address, but never from HTTPS to what anybody can change."""

    def redirect_request(self, req, fp, code, msg, headers, newurl):
        kind, _, _ = newurl.partition(":")
        if kind.lower() != req.type:
            raise urllib.error.URLError(f"redirected to {faults.shown(newurl, 200)}")
        return super().redirect_request(req, fp, code, msg, headers, newurl)
