"""`python -m alignerf` is `why-blurry`."""

import runpy

if __name__ == "__main__":
    runpy.run_module("alignerf.cli.why_blurry", run_name="__main__")
