"""A flight planned over an area, its accuracy predicted, and control placed where it helps most."""
