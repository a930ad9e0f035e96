"""The block folder: its settings, tables and points, read and written."""
