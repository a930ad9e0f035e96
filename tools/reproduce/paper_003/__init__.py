"""The blocks of paper 003 simulated, adjusted with its sets of parameters and laid beside its figures."""
