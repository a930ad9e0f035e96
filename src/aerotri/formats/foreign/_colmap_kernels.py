"""Where the object points of a COLMAP file begin: records of variable length, one behind the other."""

from __future__ import annotations

from aerotri.compiled import kernel

FIXED = 51
"""Bytes of a record before its track: number, coordinates, colour, error and length of the track."""


@kernel
def find_points(raw, offsets):
    """Fill in the place of every record; whether all of them lie in the file.

    raw : (b,) uint8. offsets : (N,) int64, out.
    """
    at = 8
    for k in range(len(offsets)):
        if at + FIXED > len(raw):
            return False
        offsets[k] = at
        length = 0
        for byte in range(7, -1, -1):
            if length > len(raw):
                return False
            length = length * 256 + raw[at + FIXED - 8 + byte]
        at += FIXED + 8 * length
    return at <= len(raw)
