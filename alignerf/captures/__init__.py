"""The registry of captures: each module holds one record, `CAPTURE`, of one source.

`base` says what a record has to answer. A new source is one new file here, or another
package's entry point under `alignerf.captures`. A plan imports every record, so a
record imports libraries of numbers and images inside the functions that read files.
"""
