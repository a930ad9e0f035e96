"""True orthophotos: every cell of the ground from the photograph that sees it best."""
