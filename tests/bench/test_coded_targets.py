"""Coded targets: the number that was drawn, where it was drawn, under perspective and noise; none on texture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from aerotri.bench.code_tables import ring_codes, square_codes
from aerotri.bench.coded_targets import find_coded

SIZE, FINE = 160, 6


def perspective(centre, size: float, turn: float, tilt: float, focal: float = 1500.0) -> np.ndarray:
    """(3, 3) from the plane of a target, middle 0 and half a side 1, to the photograph: turned, tilted, of a camera."""
    c, s = np.cos(turn), np.sin(turn)
    about_z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    rotation = about_x @ about_z
    plane = np.column_stack([rotation[:, 0], rotation[:, 1], [0.0, 0.0, focal / size]])
    return np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]]) @ plane


def photographed(shape, h: np.ndarray, noise: float, seed: int) -> np.ndarray:
    """What a camera sees: `shape` gives the grey of places (n, 2) of the plane, NaN beyond the target."""
    rng = np.random.default_rng(seed)
    fine = (np.arange(SIZE * FINE) + 0.5) / FINE
    x, y = np.meshgrid(fine, fine)
    back = np.linalg.inv(h) @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    grey = shape((back[:2] / back[2]).T).reshape(x.shape)
    ground = cv2.resize(110 + 30 * gaussian_filter(rng.normal(size=(SIZE, SIZE)), 2) / 0.14, (x.shape[1], x.shape[0]))
    seen = gaussian_filter(np.where(np.isnan(grey), ground, grey), 0.6 * FINE)
    return seen.reshape(SIZE, FINE, SIZE, FINE).mean(axis=(1, 3)) + rng.normal(0, noise, (SIZE, SIZE))


def square(dictionary: int, bits: int, number: int):
    """OpenCV's own drawing of a marker, with a white margin of a module."""
    modules = bits + 2
    drawn = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(dictionary), number, modules)
    white = np.pad(drawn, 1, constant_values=255) / 255.0

    def grey(uv):
        cell = np.floor((uv + 1.0) / 2.0 * (modules + 2)).astype(int)
        inside = ((cell >= 0) & (cell < modules + 2)).all(axis=1)
        cell = np.clip(cell, 0, modules + 1)
        return np.where(inside, 30.0 + 190.0 * white[cell[:, 1], cell[:, 0]], np.nan)

    return grey


def ring(code: int, bits: int, inverted: bool):
    """A disc of a radius of 0.3, segments from 0.6 to 0.9, the highest bit first and clockwise."""

    def grey(uv):
        radius, angle = np.hypot(*uv.T), np.arctan2(uv[:, 1], uv[:, 0]) % (2 * np.pi)
        bit = code >> (bits - 1 - (angle / (2 * np.pi) * bits).astype(int) % bits) & 1
        white = (radius < 0.3) | ((radius >= 0.6) & (radius < 0.9) & (bit == 1))
        value = 30.0 + 190.0 * (white != inverted)
        return np.where(np.abs(uv).max(axis=1) < 1.05, value, np.nan)

    return grey


def found_one(piece):
    found = find_coded(piece)
    assert len(found) == 1
    return found[0]


SQUARES = [
    ("ArUco 4x4", cv2.aruco.DICT_4X4_50, 4, 17), ("ArUco 5x5", cv2.aruco.DICT_5X5_100, 5, 99),
    ("ArUco 6x6", cv2.aruco.DICT_6X6_250, 6, 203), ("AprilTag 36h11", cv2.aruco.DICT_APRILTAG_36h11, 6, 431),
    ("AprilTag 25h9", cv2.aruco.DICT_APRILTAG_25h9, 5, 7),
]  # fmt: skip
VIEWS = [(0.0, 0.0), (0.5, 0.3), (2.1, 0.7), (-1.2, 0.9)]


@pytest.mark.parametrize(("family", "dictionary", "bits", "number"), SQUARES)
@pytest.mark.parametrize(("turn", "tilt", "half"), [(*VIEWS[0], 26.0), (*VIEWS[2], 26.0), (*VIEWS[3], 50.0)])
def test_square_is_read_where_it_is(family, dictionary, bits, number, turn, tilt, half):
    centre = np.array([80.37, 78.81])
    piece = photographed(square(dictionary, bits, number), perspective(centre, half, turn, tilt), 4.0, number)
    one = found_one(piece)
    assert (one.family, one.number) == (family, number)
    assert np.hypot(*(one.place - centre)) < 0.1
    assert one.sigma_px < 0.1


@pytest.mark.parametrize(("bits", "number"), [(12, 1), (12, 60), (12, 146), (14, 300)])
@pytest.mark.parametrize(("turn", "tilt", "half"), [(*VIEWS[0], 24.0), (*VIEWS[1], 50.0), (*VIEWS[3], 24.0)])
@pytest.mark.parametrize("inverted", [False, True])
def test_ring_is_read_where_it_is(bits, number, turn, tilt, half, inverted):
    centre = np.array([79.12, 80.66])
    code = min(code for code, one in ring_codes(bits).items() if one.number == number)
    piece = photographed(ring(code, bits, inverted), perspective(centre, half, turn, tilt), 4.0, number)
    one = found_one(piece)
    assert (one.family, one.number) == (f"ring of {bits} bits", number)
    assert np.hypot(*(one.place - centre)) < 0.1
    assert one.sigma_px < 0.1


@pytest.mark.parametrize("bits", [12, 14])
def test_no_ring_is_read_as_another(bits):
    """Small ones, a few of all numbers, under the perspectives above: the number drawn, or none."""
    codes = sorted({min(code for code, one in ring_codes(bits).items() if one.number == number): number
                    for number in range(1, 140, 7)}.items())  # fmt: skip
    read = 0
    for k, (code, number) in enumerate(codes):
        turn, tilt = VIEWS[k % len(VIEWS)]
        piece = photographed(ring(code, bits, k % 2 == 0), perspective((80.2, 79.7), 21.0, turn, tilt), 6.0, k)
        found = [(one.family, one.number) for one in find_coded(piece)]
        assert found in ([], [(f"ring of {bits} bits", number)])
        read += len(found)
    assert read > len(codes) / 2


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("smooth", [1.0, 2.5, 5.0])
def test_texture_has_no_number(seed, smooth):
    rng = np.random.default_rng(seed)
    ground = gaussian_filter(rng.normal(size=(400, 400)), smooth)
    assert find_coded(128 + 60 * ground / ground.std()) == ()
    # roofs and fields: squares and discs of one grey each
    boxes = np.full((400, 400), 100.0)
    for _ in range(60):
        row, column, tall, wide = rng.integers(0, 360, 4) // [1, 1, 8, 8]
        boxes[row : row + tall + 8, column : column + wide + 8] = rng.uniform(0, 255)
        cv2.circle(boxes, tuple(map(int, rng.integers(20, 380, 2))), int(rng.integers(3, 20)), rng.uniform(0, 255), -1)
    assert find_coded(gaussian_filter(boxes, 0.7) + rng.normal(0, 3, boxes.shape)) == ()


@pytest.mark.parametrize("bits", [12, 14])
def test_whole_ring_is_the_same_in_every_family_and_has_no_number(bits):
    piece = photographed(ring(2**bits - 1, bits, False), perspective((80.0, 80.0), 40.0, 0.3, 0.2), 4.0, 1)
    assert find_coded(piece) == ()


def test_plain_cross_board_and_disc_have_no_number():
    for shape in (
        lambda uv: np.where(uv[:, 0] * uv[:, 1] > 0, 220.0, 30.0),
        lambda uv: 30.0 + 190.0 * (np.hypot(*uv.T) < 0.5),
    ):
        piece = photographed(lambda uv, of=shape: np.where(np.abs(uv).max(axis=1) < 1, of(uv), np.nan),
                             perspective((80.0, 80.0), 30.0, 0.3, 0.2), 4.0, 1)  # fmt: skip
        assert find_coded(piece) == ()


def test_numbers_of_rings_are_as_many_as_the_scheme_has():
    """Published sheets of 14 bits have 516 targets."""
    assert len({one.number for one in ring_codes(14).values()}) == 516
    for bits in (12, 14):
        assert all(code.bit_count() % 2 == 0 for code in ring_codes(bits))


@pytest.mark.parametrize("side", [4, 5, 6, 7])
def test_squares_are_told_apart_within_a_family(side):
    for codes in square_codes(side).values():
        families = [one.family for one in codes]
        assert len(set(families)) == len({(one.family, one.number) for one in codes})
