"""Loops over the millions of records of a COLMAP model."""

from __future__ import annotations

from aerotri.compiled import kernel

FIXED = 51
"""Bytes of a record before its track: number, coordinates, colour, error and length of the track."""


@kernel
def find_points(raw, offsets):
    """Fill in where every object point begins, in records of variable length; whether all of them lie in the file.

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


@kernel
def find_points_in(raw, offsets):
    """Fill in where object points begin, as many as there are whole; how many, and where they end.

    raw : (b,) uint8, from the beginning of one. offsets : (N,) int64, out.
    """
    at = 0
    for k in range(len(offsets)):
        if at + FIXED > len(raw):
            return k, at
        length = 0
        for byte in range(7, -1, -1):
            if length > len(raw):
                return k, at
            length = length * 256 + raw[at + FIXED - 8 + byte]
        if at + FIXED + 8 * length > len(raw):
            return k, at
        offsets[k] = at
        at += FIXED + 8 * length
    return len(offsets), at


@kernel
def number_by_appearance(point, place, index):
    """Number object points 0, 1, 2 … in the order in which they appear; how many there are.

    point : (m,) int64, 0 ≤ point < len(place). place : (n,) int64 of −1, in and out: the number of every point.
    index : (m,) int64, out: the number of the point of every ray.
    """
    count = 0
    for k in range(len(point)):
        if place[point[k]] < 0:
            place[point[k]] = count
            count += 1
        index[k] = place[point[k]]
    return count


@kernel
def mark_repeated(image, point, last, again):
    """Mark the rays whose point the same image measured before; how many they are. Rays come image by image.

    image, point : (m,) int64. last : (N,) int64 of −1, for the points. again : (m,) bool, out.
    """
    count = 0
    for k in range(len(image)):
        again[k] = last[point[k]] == image[k]
        last[point[k]] = image[k]
        count += again[k]
    return count
