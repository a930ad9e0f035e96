"""What moves in the image errors of a block: the parts of tools/prove/what_moves.py."""
