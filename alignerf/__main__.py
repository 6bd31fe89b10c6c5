"""`python -m alignerf` is `why-blurry`."""

from alignerf.cli import why_blurry

if __name__ == "__main__":
    why_blurry.main()
