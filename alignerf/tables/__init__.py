"""The tables and their figures; `alignerf.tabulate` writes those of one scene.

`misalignment` is the paper's Table 1, `regimes` its Table 4. `controls` and `ranking`
say how far the warped test set may be trusted, `displacement` how misaligned the photos
are and by what.
"""
