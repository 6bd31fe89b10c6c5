"""Reading tables of ours: whatever is wrong with one is a ValueError that names it."""

import csv
import io
import re

import numpy as np
import pandas as pd

from alignerf.io import faults

# Columns of numbers, told by their units.
NUMBERS = re.compile(
    r"(^|_)(value|db|px|s|deg|ev|share|fraction|ratio|pixels|params|params_m|steps|rays_seen|hours)$"
    r"|(^|_)(ssim|lpips|lpips_\w+|times|epochs|round)$"
)

# Names: a photo may be called NA or 0042, a method 1, and a hash may have digits alone.
TEXTS = (
    "view test_set metric method description baseline base scene variant split field "
    "warping parts condition difference_to source origin quantity group changes beside "
    "published folder before stands_out length commit lock device "
    "environment aligned data note effect over truth reproduced"
)
TEXTS = dict.fromkeys(re.findall(r"\w+", TEXTS), str)


def read(path, *, columns=(), sep=","):
    """A table with rows, `columns` among its columns, and numbers where they belong.

    Names stay text. An empty cell is no number. Raises ValueError naming the file, and
    the column, for anything else.
    """
    if path is None:
        raise ValueError("no table is given")
    text = faults.text(path)
    try:
        lengths = [len(row) for row in csv.reader(io.StringIO(text), delimiter=sep)]
        if len(lengths := [one for one in lengths if one]) < 2:
            raise ValueError("no row")
        if len({*lengths}) > 1:
            raise ValueError("rows of different lengths")
        options = {"dtype": TEXTS, "keep_default_na": False, "na_values": [""]}
        table = pd.read_csv(io.StringIO(text), sep=sep, **options)
        if missing := set(columns) - set(table):
            raise ValueError(f"no column {min(missing)}")
        for name in filter(NUMBERS.search, table):
            if table[name].dtype.kind not in "fiu" or np.isinf(table[name]).any():
                raise ValueError(f"column {name}: not numbers")
    # The parser's own errors are such, too.
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{path}: not the table that it should be: {error}") from None
    return table


def by_view(path):
    """A table of views, by their names."""
    return read(path, columns=["view"]).set_index("view")
