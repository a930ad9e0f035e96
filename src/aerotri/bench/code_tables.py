"""Numbers of coded targets: square markers of public families, and rings of segments after Schneider (1991)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

SQUARE_FAMILIES = (
    ("ArUco 4x4", 4, cv2.aruco.DICT_4X4_1000), ("ArUco 5x5", 5, cv2.aruco.DICT_5X5_1000),
    ("ArUco 6x6", 6, cv2.aruco.DICT_6X6_1000), ("ArUco 7x7", 7, cv2.aruco.DICT_7X7_1000),
    ("ArUco original", 5, cv2.aruco.DICT_ARUCO_ORIGINAL), ("AprilTag 16h5", 4, cv2.aruco.DICT_APRILTAG_16h5),
    ("AprilTag 25h9", 5, cv2.aruco.DICT_APRILTAG_25h9), ("AprilTag 36h10", 6, cv2.aruco.DICT_APRILTAG_36h10),
    ("AprilTag 36h11", 6, cv2.aruco.DICT_APRILTAG_36h11),
)  # fmt: skip
"""Name, bits of a side, and OpenCV's dictionary; the smaller ones of ArUco are the beginning of these."""
RING_BITS = (12, 14)
MODULE_PX = 16
"""Of the ideal pictures, a module of a square or the radius of the disc of a ring."""


@dataclass(frozen=True)
class Code:
    """What a target says.

    Parameters
    ----------
    family : in words. number : as it is printed beside such targets.
    turn : quarters of a turn of a square, segments of a ring, from which it was read.
    """

    family: str
    number: int
    turn: int


@cache
def square_codes(side: int) -> dict[int, tuple[Code, ...]]:
    """Codes by the bits of a square, row by row as it is seen, 1 for white; in all four positions."""
    found: dict[int, tuple[Code, ...]] = {}
    for family, bits, dictionary in SQUARE_FAMILIES:
        if bits != side:
            continue
        for number, square in enumerate(_squares(dictionary, bits)):
            for turn in range(4):
                key = number_of(np.rot90(square, turn).ravel())
                found[key] = (*found.get(key, ()), Code(family, number, turn))
    return found


@cache
def ring_codes(bits: int) -> dict[int, Code]:
    """Codes by the segments of a ring, the highest first and clockwise as it is seen, wherever one begins.

    Of the numbers of `bits` binary digits those whose smallest rotation they are, with an even number of ones, and two
    ones that lie opposite; counted from 1 in their order.
    """
    half, full = bits // 2, 2**bits - 1
    found: dict[int, Code] = {}
    number = 0
    for code in range(1, 2 ** (bits - 1), 2):
        turned = [((code << k) & full) | (code >> (bits - k)) for k in range(bits)]
        if code != min(turned) or code.bit_count() % 2 or not (code >> half) & code & (2**half - 1):
            continue
        number += 1
        found |= {one: Code(f"ring of {bits} bits", number, k) for k, one in reversed([*enumerate(turned)])}
    return found


@cache
def square_picture(family: str, number: int) -> np.ndarray:
    """The ideal square, grey 0 … 1, with a margin of one white module."""
    bits, dictionary = next((bits, one) for name, bits, one in SQUARE_FAMILIES if name == family)
    inner = np.zeros((bits + 2, bits + 2))
    inner[1:-1, 1:-1] = _squares(dictionary, bits)[number]
    return np.kron(np.pad(inner, 1, constant_values=1.0), np.ones((MODULE_PX, MODULE_PX)))


@cache
def ring_picture(bits: int, number: int) -> np.ndarray:
    """The ideal ring with its disc, grey 0 … 1, white on black; its middle is the middle, 4 radii of the disc from the
    edge."""
    code = next(code for code, one in ring_codes(bits).items() if one.number == number and one.turn == 0)
    side = 8 * MODULE_PX
    x, y = np.meshgrid(*[(np.arange(side) + 0.5) / MODULE_PX - 4.0] * 2)
    radius, segment = np.hypot(x, y), (np.arctan2(y, x) % (2 * np.pi) * bits / (2 * np.pi)).astype(int) % bits
    is_one = np.array([code >> (bits - 1 - k) & 1 for k in range(bits)], dtype=bool)[segment]
    return ((radius < 1.0) | (is_one & (radius >= 2.0) & (radius < 3.0))).astype(float)


def number_of(bits: np.ndarray) -> int:
    """The number that bits (n,) write, the highest first."""
    return int("".join("1" if one else "0" for one in bits), 2)


@cache
def _squares(dictionary: int, bits: int) -> list[np.ndarray]:
    """(bits, bits) of every number."""
    opened = cv2.aruco.getPredefinedDictionary(dictionary)
    return [
        np.asarray(cv2.aruco.Dictionary.getBitsFromByteList(opened.bytesList[k : k + 1], bits), dtype=bool)
        for k in range(len(opened.bytesList))
    ]
