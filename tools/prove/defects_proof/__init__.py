"""Deficient and just-determined blocks, and the looks at them, for `prove_defects.py`."""
