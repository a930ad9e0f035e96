"""Systematic image errors of the DMC, written anew for the cross-check.

Nothing here comes from `functional_model`. No derivative of the head geometry is written out: all come from the complex
step, so that a head is described by one function, its projection into the composed image.

Axes are those of the composed image, x across and y along the flight, mm. Quadrants count counter-clockwise from the
upper right.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

TILT_ACROSS, TILT_ALONG = np.radians(16.0), np.radians(11.0)
"""Inclination of the axis of a head across and along the flight [D]."""
HALF_DIAGONAL_OF_HEAD = float(np.hypot(3584.0, 2048.0)) * 0.012
"""Of the 7168 × 4096 pixels of a head, mm [L]."""
NORMAL_DIAGONAL = 115.0 * 2.0**0.5
"""Half diagonal of the film that the constants of BLUH are meant for, mm [D]."""
QUADRANTS = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
"""Signs of x and y in quadrants 1 to 4 [C]."""
SEAM_POINTS, GRID = 41, (61, 41)
"""Points on each seam, and of the grid over the format, that define the butterfly [D]."""
STEP = 1e-30
"""Imaginary step of the derivatives [L: Squire and Trapp 1998]."""

SYNCHRONISATION = ("30", "31", "32", "33")
ORIENTATION_X, ORIENTATION_Y = ("34", "36", "38", "40"), ("35", "37", "39", "41")
RADIAL = ("74", "75", "76", "77")
BUTTERFLY, COMMON_RADIAL = "79", "80"
ITEMS = (*SYNCHRONISATION, *ORIENTATION_X, *ORIENTATION_Y, *RADIAL, BUTTERFLY, COMMON_RADIAL)
"""Numbers of the special parameters of the DMC that are patterns of the image [P]."""


@dataclass(frozen=True)
class Composed:
    """The composed image: principal distance, of the heads too, and half extent across and along the flight, mm.

    120 mm, and 82.944 × 46.08 mm of the 13824 × 7680 pixels of 12 µm [L], where the camera states no others.
    """

    principal_distance: float = 120.0
    half_across: float = 82.944
    half_along: float = 46.08


def dmc(
    x: np.ndarray, y: np.ndarray, flight_axis: str, items: tuple[str, ...], image: Composed | None = None
) -> np.ndarray:
    """Special parameters of BLUH for the DMC [P: Spreckels, Schlienkamp, Jacobsen, Table 1; geometry of the heads D].

    Parameters
    ----------
    x, y : (m,) mm from the image centre. flight_axis : image axis along the flight. items : of `ITEMS`.
    image : the composed image.

    Returns
    -------
    (m, 2, q) mm, in the axes of the image.
    """
    along = {"+x": (1.0, 0.0), "-x": (-1.0, 0.0), "+y": (0.0, 1.0), "-y": (0.0, -1.0)}[flight_axis]
    across = (along[1], -along[0])
    right, forward = x * across[0] + y * across[1], x * along[0] + y * along[1]
    patterns = np.zeros((len(x), 2, len(items)))
    for column, item in enumerate(items):
        d_across, d_along = _pattern(item, right, forward, image or Composed())
        patterns[:, 0, column] = d_across * across[0] + d_along * along[0]
        patterns[:, 1, column] = d_across * across[1] + d_along * along[1]
    return patterns


def _pattern(item: str, x: np.ndarray, y: np.ndarray, image: Composed) -> tuple[np.ndarray, np.ndarray]:
    """Image error across and along the flight per unit of a parameter, mm."""
    nothing = np.zeros(len(x))
    if item == COMMON_RADIAL:
        parts = [_pattern(number, x, y, image) for number in RADIAL]
        return sum((dx for dx, _ in parts), nothing), sum((dy for _, dy in parts), nothing)
    if item == BUTTERFLY:
        return _butterfly(x, y, image)
    for numbers, formula in OF_ONE_HEAD:
        if item in numbers:
            head = numbers.index(item)
            inside = _quadrant(x, y) == head
            dx, dy = formula(x, y, Head(QUADRANTS[head], image.principal_distance))
            return np.where(inside, dx, 0.0), np.where(inside, dy, 0.0)
    raise KeyError(item)


def _quadrant(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """0 to 3; a point on an axis is to its right, or above it [C]."""
    return np.where(y >= 0.0, np.where(x >= 0.0, 0, 1), np.where(x >= 0.0, 3, 2))


@dataclass(frozen=True)
class Head:
    """A head: signs of x and y in its quadrant, and its principal distance, mm."""

    signs: tuple[float, float]
    principal_distance: float

    def rotation(self) -> np.ndarray:
        """(3, 3) head → camera: Ry(−sx·16°)·Rx(sy·11°) [D]."""
        about_y, about_x = -self.signs[0] * TILT_ACROSS, self.signs[1] * TILT_ALONG
        cos_y, sin_y, cos_x, sin_x = np.cos(about_y), np.sin(about_y), np.cos(about_x), np.sin(about_x)
        turn_y = np.array([[cos_y, 0.0, sin_y], [0.0, 1.0, 0.0], [-sin_y, 0.0, cos_y]])
        turn_x = np.array([[1.0, 0.0, 0.0], [0.0, cos_x, -sin_x], [0.0, sin_x, cos_x]])
        return turn_y @ turn_x

    def in_plane(self, direction: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Where a direction meets an image plane at the principal distance, mm; may be complex."""
        u1, u2, u3 = direction
        return -self.principal_distance * u1 / u3, -self.principal_distance * u2 / u3

    def direction(self, x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
        """(ξ, η, −f) in the head of a position in the composed image."""
        minus_f = np.full(len(x), -self.principal_distance)
        xi, eta = self.in_plane(_turned(self.rotation().T, [x, y, minus_f]))
        return [xi, eta, minus_f]

    def displacement(self, direction: list[np.ndarray], change: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """How the position in the composed image changes with the direction in the head, by the complex step."""
        moved = [part + 1j * STEP * by for part, by in zip(direction, change, strict=True)]
        x, y = self.in_plane(_turned(self.rotation(), moved))
        return np.imag(x) / STEP, np.imag(y) / STEP


def _turned(matrix: np.ndarray, vector: list[np.ndarray]) -> list[np.ndarray]:
    return [matrix[i, 0] * vector[0] + matrix[i, 1] * vector[1] + matrix[i, 2] * vector[2] for i in range(3)]


def _radial(x: np.ndarray, y: np.ndarray, head: Head) -> tuple[np.ndarray, np.ndarray]:
    """−(ξ, η)·((s·ρ)² − 16384) of a head, seen in the composed image [D]."""
    direction = head.direction(x, y)
    xi, eta, _ = direction
    enlargement = NORMAL_DIAGONAL / HALF_DIAGONAL_OF_HEAD
    factor = -(enlargement**2 * (xi**2 + eta**2) - 16384.0)
    return head.displacement(direction, [factor * xi, factor * eta, np.zeros(len(x))])


def _synchronisation(x: np.ndarray, y: np.ndarray, head: Head) -> tuple[np.ndarray, np.ndarray]:
    """A delay of the shutter acts along the flight: y² − 32·|y| [P, its axis D]."""
    return 0.0 * x, y**2 - 32.0 * np.abs(y)


def _orientation_x(x: np.ndarray, y: np.ndarray, head: Head) -> tuple[np.ndarray, np.ndarray]:
    """−x·y across the flight [P]."""
    return -x * y, 0.0 * x


def _orientation_y(x: np.ndarray, y: np.ndarray, head: Head) -> tuple[np.ndarray, np.ndarray]:
    """−x·y along the flight [P]."""
    return 0.0 * x, -x * y


OF_ONE_HEAD = (
    (SYNCHRONISATION, _synchronisation),
    (ORIENTATION_X, _orientation_x),
    (ORIENTATION_Y, _orientation_y),
    (RADIAL, _radial),
)
"""Numbers of heads 1 to 4, and the image error in a head by x, y and the head."""


def _small_turns(x: np.ndarray, y: np.ndarray, image: Composed) -> list[tuple[np.ndarray, np.ndarray]]:
    """Displacements by a longer principal distance of head 1, and by small turns of it about its three axes."""
    head = Head(QUADRANTS[0], image.principal_distance)
    direction = head.direction(x, y)
    nothing = np.zeros(len(x))
    changes = [[direction[0], direction[1], nothing]]
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn = [nothing, nothing, nothing]
        turn[i], turn[j] = -direction[j], direction[i]
        changes.append(turn)
    return [head.displacement(direction, change) for change in changes]


@lru_cache(maxsize=16)
def stitching(image: Composed) -> tuple[float, float, float]:
    """Turns of head 1 that close the seams best when its principal distance grows [D]: dx(0, y) = 0, dy(x, 0) = 0."""
    zero = np.zeros(SEAM_POINTS)
    up = _small_turns(zero, np.linspace(0.0, image.half_along, SEAM_POINTS), image)
    out = _small_turns(np.linspace(0.0, image.half_across, SEAM_POINTS), zero, image)
    gaps = np.array([np.concatenate([dx, dy]) for (dx, _), (_, dy) in zip(up, out, strict=True)])
    turns = np.linalg.lstsq(gaps[1:].T, -gaps[0], rcond=None)[0]
    return float(turns[0]), float(turns[1]), float(turns[2])


def stitched(
    x: np.ndarray, y: np.ndarray, signs: tuple[np.ndarray, np.ndarray], image: Composed
) -> tuple[np.ndarray, np.ndarray]:
    """The butterfly before the orientation is taken off: quadrant 1, mirrored to the others by the signs of x and y."""
    longer, *turns = _small_turns(np.abs(x), np.abs(y), image)
    dx, dy = longer
    for by, (tx, ty) in zip(stitching(image), turns, strict=True):
        dx, dy = dx + by * tx, dy + by * ty
    return signs[0] * dx, signs[1] * dy


def _orientation(x: np.ndarray, y: np.ndarray, f: float) -> np.ndarray:
    """(2m, 6): what shifts, scale, rotation and tilts of a photograph over flat ground do."""
    one, zero = np.ones(len(x)), np.zeros(len(x))
    pairs = [(one, zero), (zero, one), (x, y), (-y, x), (f + x**2 / f, x * y / f), (x * y / f, f + y**2 / f)]
    return np.stack([np.concatenate(pair) for pair in pairs], axis=1)


@lru_cache(maxsize=16)
def _absorbed(image: Composed) -> np.ndarray:
    """(6,) what the orientation of a photograph takes of the stitched butterfly, by least squares over the format."""
    across, along = (
        half * np.arange(-(count // 2), count // 2 + 1) / (count // 2)
        for half, count in zip((image.half_across, image.half_along), GRID, strict=True)
    )
    x, y = (part.ravel() for part in np.meshgrid(across, along))
    # the two heads at a seam err oppositely: on the seam itself their mean counts, which is 0
    pattern = np.concatenate(stitched(x, y, (np.sign(x), np.sign(y)), image))
    return np.linalg.lstsq(_orientation(x, y, image.principal_distance), pattern, rcond=None)[0]


def _butterfly(x: np.ndarray, y: np.ndarray, image: Composed) -> tuple[np.ndarray, np.ndarray]:
    """A common change of the principal distance of the heads, less what stitching and orientation absorb [D]."""
    dx, dy = stitched(x, y, (np.where(x >= 0.0, 1.0, -1.0), np.where(y >= 0.0, 1.0, -1.0)), image)
    absorbed = _orientation(x, y, image.principal_distance) @ _absorbed(image)
    return dx - absorbed[: len(x)], dy - absorbed[len(x) :]
