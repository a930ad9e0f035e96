"""Terrain by image matching: pickets with σ, surfaces, and their comparison."""
