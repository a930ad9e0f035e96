"""Parts of tools/fuzz.py: seeds, mutations, readers, workers, table."""
