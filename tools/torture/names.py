"""Names that nobody expects: what is taken is read back as it was written.

Of scenes, from a folder's name to the config; of views, and of all texts in tables.
"""

import contextlib
import io
import os

import pandas as pd
import yaml

from alignerf.cli import __main__ as start
from alignerf.cli import folders
from alignerf.experiment import check
from alignerf.io import csv_files, faults
from alignerf.scenes import prepared

# Parts that one reader or another takes for more than letters.
PARTS = (
    *("a", "0", "007", "1e3", "1_0", "0x1f", "-1", "+", ".", "..", "~", "=", "@", "*"),
    *("NA", "nan", "inf", "null", "None", "true", "no", "on", "12:30", "2020-01-01"),
    *(" ", "\t", "\n", "\r", "\0", "\x1b[2J", "\x85", "\u2028", "\u202e", "\ufeff"),
    *(",", ";", '"', "'", "`", "\\", "/", "$(x)", "%03d", "%s", "{x}", "<x>", "[0-9]"),
    *(
        "é",
        "e\u0301",
        "写",
        "\udc80",
        "🙂",
        "aaaaaaaaaaaaaaaaaaaaa",
        "<b>",
        "&amp;",
        "#",
    ),
    *("all", "train", "poses", "results", "torture", "published", ".png", "con", "|"),
)
TEXTS = sorted(csv_files.TEXTS)


def drawn(random):
    """A name of one part to four."""
    return "".join(random.choices(PARTS, k=random.randint(1, 4)))


def of_table(name, folder, random):
    """A view's name, through a table."""
    if not prepared.is_name(name):
        return None
    path, column = folder / "a.csv", random.choice(TEXTS)
    pd.DataFrame({column: [name], "ssim": [0.5]}).to_csv(path, index=False)
    read = csv_files.read(path)[column][0]
    return None if read == name else f"{column} {name!r} is read as {read!r}"


def of_folder(name, folder, random):
    """A folder of photos: its config is read back, and has its folder and its name."""
    try:
        place = folder / "photos" / name
        place.mkdir(parents=True)
        (place / "a.jpg").touch()
    except (OSError, ValueError):
        # No folder's name.
        return None
    said = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(said):
        for old in folder.glob("results/*.yaml"):
            old.unlink()
        try:
            start.main([str(place), "--only-config"])
            (written,) = folder.glob("results/*.yaml")
            config = check.checked(yaml.safe_load(written.read_text()))
        except ValueError as error:
            return None if faults.one_line(str(error)).isprintable() else "no line"
    lines = said.getvalue().splitlines()
    if not all(map(str.isprintable, lines)):
        return f"folder {name!r}: prints {lines}"
    first, one = next(iter(config["scenes"].items()))
    if first != written.stem or first != folders.name_of(place):
        return f"folder {name!r}: scene {first!r} in {written.name}"
    same = os.path.realpath(one["path"]) == os.path.realpath(place)
    return None if same else f"folder {name!r}: config has {one['path']!r}"
