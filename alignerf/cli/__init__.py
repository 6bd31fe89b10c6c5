"""From a folder to its page, without a config: `make photos FOLDER=my_photos`.

`folders` looks at what a folder holds; the command writes the config that says so, and
runs it.
"""
