"""Results for programs that draw maps: layers of a GeoPackage, GeoParquet, STAC."""
