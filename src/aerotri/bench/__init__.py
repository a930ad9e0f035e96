"""The bench: a result looked at and mended in the browser, on this machine alone."""
