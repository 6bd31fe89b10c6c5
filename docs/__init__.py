"""The pages, and the command that makes their tables: `python -m docs.tables`."""
