"""Print the finished misalignment tables: `python -m alignerf.show [results]`."""

import argparse
import pathlib

import pandas as pd

from alignerf import cli


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", nargs="?", default="results", type=pathlib.Path)
    args = parser.parse_args(argv)
    tables = sorted(args.results.glob("*/tables/misalignment.csv"))
    if not tables:
        raise ValueError(f"{args.results}: no misalignment table in it yet")
    for path in tables:
        print(f"\n{path.parent.parent.name}")
        print(pivot(pd.read_csv(path)).to_string(na_rep="--"))
        print(f"tables   {path}, {path.with_suffix('.tex').name}")
        print(f"figures  {path.parent.parent / 'figures'}/")


def pivot(table):
    """PSNR in dB per method and warping, test sets side by side, and the cost."""
    keys = ["method", "warping"]
    psnr = table.pivot(index=keys, columns="test_set", values="psnr_db").round(2)
    costs = table.drop_duplicates(keys).set_index(keys)
    psnr = psnr.reindex(costs.index)[list(dict.fromkeys(table["test_set"]))]
    psnr.columns = [f"{name} dB" for name in psnr.columns]
    cost = costs[["train_time_s", "data_time_s", "params"]].round(0).astype(int)
    return psnr.join(cost)


if __name__ == "__main__":
    cli.run(main)
