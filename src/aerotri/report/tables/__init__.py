"""Tables of the report as plain data, and as lines for a terminal."""
