"""Volumes between a surface and a base, and how sure they are."""
