"""Every key of a config: its default, its bounds and its meaning, by section.

Pydantic checks a config with these classes, see `schema`; `alignerf.config` makes
`workflow/schemas/config.schema.yaml` of them for editors. A config says only what
differs from the defaults. Where a module has the same default for its own callers, a
test holds both equal. Numbers are finite; `least` and `most` bound them, `above` leaves
the bound itself out. Units are in the names. A stage runs again for a change of the
sections that it reads: `tests/alignerf/experiment/test_sections.py` lists them.
"""
