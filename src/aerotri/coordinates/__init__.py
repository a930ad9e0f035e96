"""Coordinate reference systems: between a CRS and the local topocentric frame in which a block is adjusted."""

from aerotri.coordinates.local_frame import LocalFrame, local_frame

__all__ = ["LocalFrame", "local_frame"]
