"""What adjusts again to find out: gross errors, sets of parameters, variance components, fields, a free check."""
