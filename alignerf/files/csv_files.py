"""Reading tables of ours: whatever is wrong with one is a ValueError that names it."""

import csv
import io
import re

import numpy as np
import pandas as pd

from alignerf.files import faults

# Columns of numbers, told by their units.
NUMBERS = re.compile(
    r"(^|_)(value|db|px|s|deg|ev|share|ratio|pixels|params|params_m|steps|rays_seen|hours)$"
    r"|^(ssim|lpips_\w+)$"
)

# Of these none is below 0: a render and a photo are 1 apart at the most.
FROM_ZERO = re.compile(
    r"^(psnr_db|median_px|mean_px|p95_px|blur_sigma_px|valid_share|pixels|time_s"
    r"|params|steps|rays_seen|lpips_\w+)$"
)

# Names: a photo may be called NA or 0042, a method 1, and a hash may have digits alone.
TEXTS = dict.fromkeys(
    (
        *("view", "test_set", "metric", "method", "description", "baseline", "base"),
        *("scene", "variant", "split", "field", "warping", "parts", "condition"),
        *(
            "difference_to",
            "source",
            "origin",
            "quantity",
            "group",
            "changes",
            "beside",
        ),
        *("published", "folder", "way", "flows", "corrected", "before", "stands_out"),
        *("commit", "lock", "device", "environment"),
    ),
    str,
)


def read(path, *, columns=(), sep=","):
    """A table with rows, `columns` among its columns, and numbers where they belong.

    Names stay text. An empty cell is no number. Raises ValueError naming the file, and
    the column, for anything else.
    """
    if path is None:
        raise ValueError("no table is given")
    try:
        text = faults.text(path)
        check_rows(text, sep)
        table = pd.read_csv(
            io.StringIO(text),
            sep=sep,
            dtype=TEXTS,
            keep_default_na=False,
            na_values=[""],
        )
        check_columns(table, columns)
    except faults.Named:
        raise
    # The parser's own errors.
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{path}: not the table that it should be: {error}") from None
    return table


def check_rows(text, sep):
    """ValueError where a row has not as many cells as the head, or there is none."""
    if "\0" in text:
        raise ValueError("a byte of zero in it")
    rows = csv.reader(io.StringIO(text, newline=""), delimiter=sep, strict=True)
    head = next(rows, [])
    if len(set(head)) < len(head):
        raise ValueError("a column stands twice")
    numbers = [place for place, name in enumerate(head) if NUMBERS.search(name)]
    count = 0
    for count, row in enumerate(rows, 1):
        # As pandas does, which leaves an empty line out.
        if row and len(row) != len(head):
            raise ValueError(f"row {count} has {len(row)} cells, the head {len(head)}")
        # What is not known is an empty cell: a NaN is written by nobody here.
        if row and (odd := [n for n in numbers if row[n].strip().lower() == "nan"]):
            raise ValueError(f"column {head[odd[0]]}: nan in row {count}")
    if not count:
        raise ValueError("no row")
    if not text.endswith("\n"):
        raise ValueError("its last line is cut off")


def check_columns(table, columns):
    """ValueError where a column is missing, or one of numbers holds anything else."""
    if missing := set(columns) - set(table):
        raise ValueError(f"no column {min(missing)}")
    if "view" in table and table.duplicated().any():
        raise ValueError(
            f"two equal rows of view {table.view[table.duplicated()][:1].item()}"
        )
    for name in filter(NUMBERS.search, table):
        if table[name].dtype.kind not in "fiu":
            raise ValueError(f"column {name}: not numbers")
        if np.isinf(table[name]).any():
            raise ValueError(f"column {name}: not finite")
        if FROM_ZERO.search(name) and (table[name] < 0).any():
            raise ValueError(f"column {name}: below 0")
