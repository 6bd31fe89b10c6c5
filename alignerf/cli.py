"""What every entry point shares: plain errors, logging, whole outputs or none."""

import contextlib
import json
import logging
import os
import shutil
import sys
import tempfile
from pathlib import Path

log = logging.getLogger("alignerf")


def run(main):
    """Call main() with logging on; a fault of the input is one line, no traceback.

    Pure modules raise ValueError for what a user can cause and the system raises
    OSError; both become `error: ...` on stderr with exit status 1. The traceback
    is for developers: set ALIGNERF_DEBUG=1.
    """
    logging.basicConfig(format="%(message)s", stream=sys.stderr)
    log.setLevel(logging.INFO)
    try:
        main()
    except (ValueError, OSError) as error:
        if os.environ.get("ALIGNERF_DEBUG"):
            raise
        message = " ".join(str(error).split()) or type(error).__name__
        print(f"error: {message}", file=sys.stderr)
        sys.exit(1)


def read_config(text):
    """A stage's slice of the config: a JSON object, or the path of a file of one."""
    if not text.lstrip().startswith("{"):
        text = Path(text).read_text(encoding="utf-8")
    try:
        config = json.loads(text)
    except json.JSONDecodeError as error:
        raise ValueError(f"--config is not JSON: {error}") from None
    if not isinstance(config, dict):
        raise ValueError("--config must be a JSON object")
    return config


def fill_defaults(config, defaults, *, name="config"):
    """Nested dict `config` over `defaults`; a key that no default has is refused.

    A default that is a dict is filled recursively; other values are checked to be
    of their default's type (None accepts any, an int passes for a float).
    """
    unknown = sorted(set(config) - set(defaults))
    if unknown:
        raise ValueError(f"{name}: unknown key {unknown[0]!r}")
    filled = dict(defaults)
    for key, value in config.items():
        default = defaults[key]
        if isinstance(default, dict) and isinstance(value, dict):
            value = fill_defaults(value, default, name=f"{name}.{key}")
        elif default is not None and not _same_type(value, default):
            expected = type(default).__name__
            raise ValueError(f"{name}: {key} must be of type {expected}, not {value!r}")
        filled[key] = value
    return filled


def check_least(config, least, *, name=""):
    """ValueError for a value of `config` below what `least` {key: number} asks."""
    for key, bound in least.items():
        if not config[key] >= bound:
            raise ValueError(
                f"{name}{key}: must be at least {bound}, not {config[key]}"
            )


def _same_type(value, default):
    if isinstance(value, bool) or isinstance(default, bool):
        return isinstance(value, bool) and isinstance(default, bool)
    accepted = (int, float) if isinstance(default, float) else type(default)
    return isinstance(value, accepted)


@contextlib.contextmanager
def replace_file(path):
    """Yield a temporary path beside `path` that takes its place on success.

    The temporary name keeps the suffix, which writers choose their format by.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(
        dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix
    )
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def replace_folder(path):
    """Yield a temporary folder beside `path` that takes its place on success."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with scratch_folder(path.parent, prefix=f".{path.name}.") as scratch:
        fresh = scratch / "new"
        fresh.mkdir()
        yield fresh
        move(fresh, path)


def move(source, target):
    """Rename a whole file or folder onto `target`, on the same file system."""
    if Path(source).is_dir():
        # A folder cannot be renamed onto a full one: the old one steps aside first.
        with scratch_folder(Path(target).parent, prefix=".old.") as scratch:
            with contextlib.suppress(FileNotFoundError):
                os.rename(target, scratch / "old")
            os.rename(source, target)
    else:
        os.replace(source, target)


@contextlib.contextmanager
def scratch_folder(parent, *, prefix=".scratch."):
    """Yield a folder inside `parent` that is gone afterwards, whatever happens.

    A `parent` that did not exist and is still empty goes with it, so that a failed
    stage leaves nothing behind.
    """
    parent = Path(parent)
    existed = parent.exists()
    parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(dir=parent, prefix=prefix))
    try:
        yield scratch
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
        if not existed:
            with contextlib.suppress(OSError):
                parent.rmdir()


def _umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask
