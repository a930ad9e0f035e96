"""Change between two surfaces against its σ."""
