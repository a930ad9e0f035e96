"""The strip of paper 002: what is simulated, the table, the plot."""
