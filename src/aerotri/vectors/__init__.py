"""Vector files: polygons, lines and points with their coordinate system."""
