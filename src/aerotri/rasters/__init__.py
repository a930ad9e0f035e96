"""Rasters and photographs read and written by windows; nothing else knows rasterio."""
