"""Text formats: CSV, TOML, XML and tables, checked line by line."""
