"""Published files, fetched by HTTPS and checked; a stopped download goes on."""

import hashlib
import http.client
import urllib.error
import urllib.request
from pathlib import Path
from typing import NamedTuple

from alignerf.io import faults, progress

BLOCK_BYTES = 1 << 20
TIMEOUT_S = 60
PARTIAL, WHOLE = 206, 416


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

    Raises ValueError where the server, or the way to it, fails; what has come stays.
    """
    path = Path(folder) / published.name
    done = path.stat().st_size if path.exists() else 0
    try:
        with opened(published.url, done) as answer:
            if answer.status != PARTIAL:
                done = 0
            # A block more than there should be is enough to know.
            left = range(1 + (published.size - done) // BLOCK_BYTES)
            with open(path, "ab" if done else "wb") as file:
                for _ in progress.over(left, path.name, unit="MB"):
                    file.write(answer.read(BLOCK_BYTES))
    except (OSError, http.client.HTTPException) as error:
        if getattr(error, "code", None) == WHOLE:
            return path
        raise ValueError(f"{published.url}: {error}") from None
    return path


def opened(url, done):
    """The answer of a server that is asked for what follows `done` bytes."""
    request = urllib.request.Request(url)
    if done:
        request.add_header("Range", f"bytes={done}-")
    return urllib.request.urlopen(request, timeout=TIMEOUT_S)
