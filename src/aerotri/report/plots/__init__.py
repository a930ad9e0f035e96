"""Plots: a result goes in, a figure comes out, nothing is saved."""
