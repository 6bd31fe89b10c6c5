"""What a verdict.json has to hold, for all who read one."""

from alignerf.files import json_files

# What it tells in sentences; of the first there has to be one.
SENTENCES = ("verdict", "headline", "because", "measured")


def read(path, kinds=None, **parts):
    """The object in a verdict.json; ValueError naming it where it is not as it should.

    kinds: {key: type}, as of `json_files.check`; parts: the same of each object that is
    in a key.
    """
    content = json_files.read(path, {"verdict": list} | (kinds or {}))
    for key in SENTENCES:
        said = listed(content.get(key, [])) or [""] * (key == "verdict")
        if not all(isinstance(line, str) and line.strip() for line in said):
            raise ValueError(f"{path}: {key} is not lines of text: {said!r:.60}")
    for key, kind in parts.items():
        try:
            for one in listed(content[key]):
                json_files.check(one, kind)
        except ValueError as error:
            raise ValueError(f"{path}: {key}: {error}") from None
    return content


def stops(content):
    """Whether pairs of photo and render that are none have stopped a verdict."""
    pairs = (content.get("evidence") or {}).get("pairs") or {}
    return bool(pairs.get("stops"))


def listed(value):
    return value if isinstance(value, list) else [value]
