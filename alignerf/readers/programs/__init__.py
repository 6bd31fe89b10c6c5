"""Cameras as programs of photogrammetry export them, read into one table.

A module reads one format. It has the program's `NAME`, `PATTERNS` of its files' names,
a `MARK`, an expression that fits such a file's head, and `read(path)`, a list of
`shots.Shot`.
"""
