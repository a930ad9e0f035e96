"""Parts of tools/prove/fuzz.py: seeds, mutations, readers, workers, table."""
