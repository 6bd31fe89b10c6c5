"""The tables and their figures; `alignerf.tabulate` writes them.

`misalignment` is a scene's Table 1, `effects` what a table of the paper says beside
ours. `controls` and `ranking` say how far the warped test set may be trusted,
`displacement` how misaligned the photos are and by what.
"""
