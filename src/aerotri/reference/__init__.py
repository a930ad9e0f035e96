"""What users meet, described in one place: keys of block.toml, tables, output files, columns, JSON keys, words.

The documentation, `aerotri explain` and the JSON Schemas are made from these records; tests hold them against what the
program reads and writes.
"""
