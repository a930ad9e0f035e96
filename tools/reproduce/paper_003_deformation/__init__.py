"""Model deformation as in section 6 of paper 003: what is simulated, DEMs of even and odd photographs, table, plots."""
