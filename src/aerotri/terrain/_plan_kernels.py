"""What matching is to do, and the room it works in: the records that the kernels of this package share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel

UNKNOWNS = 9
"""Of the displacement of a window, and of the grey values, see `match_shift`."""
MOST_PLACES = 1024
"""Posts of parallax in a strip, at most."""
LANES = 32
"""Products are formed for so many places at once, some beyond the last: loops of a fixed length are the fastest."""


class Plan(NamedTuple):
    """How heights are searched and pickets measured; lengths in posts of a window unless m is said.

    posts : a side of a window, odd. window : m between posts.
    step : of the heights, in posts of parallax. most_steps : of a search.
    along_ray : searched along rays when matching backwards. distinct : share of the best correlation that another place
        there may not reach.
    correlation : from which two photographs count. agreeing : the same of three and more whose rays meet.
    largest_sigma : of a parallax. searched : correlation of the search below which nothing is measured.
    """

    posts: int
    window: float
    step: float
    most_steps: int
    along_ray: float = 0.0
    distinct: float = 0.0
    correlation: float = 0.0
    agreeing: float = 0.0
    largest_sigma: float = 0.0
    searched: float = 0.0


class Nodes(NamedTuple):
    """n nodes near one another.

    places : (n, 3) m, x, y and the prior height. slopes : (n, 2). ranges : (n, 2) m, lowest and highest height.
    chosen : (n, m) photographs, the first being the reference, −1 for none.
    """

    places: np.ndarray
    slopes: np.ndarray
    ranges: np.ndarray
    chosen: np.ndarray


class Locus(NamedTuple):
    """Places low, low + step … in height through a spot: along_x, along_y m of plan per metre of height."""

    along_x: float
    along_y: float
    low: float
    step: float


class SearchRoom(NamedTuple):
    """What `correlation_at` works in: windows of two photographs, corners, shift, correlations."""

    first: np.ndarray
    second: np.ndarray
    corner: np.ndarray
    shift: np.ndarray
    profile: np.ndarray
    values: np.ndarray


class StripRoom(NamedTuple):
    """What `strip_search` works in."""

    strip: np.ndarray
    sums: np.ndarray
    of_pair: np.ndarray
    joined: np.ndarray


class ShiftRoom(NamedTuple):
    """What `match_shift` and `intersect` work in; e is the direction of parallax, found what `match_shift` gives."""

    template: np.ndarray
    other: np.ndarray
    normal: np.ndarray
    e: np.ndarray
    found: np.ndarray
    corner: np.ndarray
    shift: np.ndarray
    weights: np.ndarray
    right: np.ndarray
    bend: np.ndarray
    cofactor: np.ndarray
    ideal: np.ndarray
    ray_weight: np.ndarray


class Rooms(NamedTuple):
    """Room for all of it."""

    search: SearchRoom
    strips: StripRoom
    shifts: ShiftRoom


class Measured(NamedTuple):
    """One picket as it is measured.

    shifts : (m, 6) plan displacement of every window against the first, m, its variances and covariance, correlation.
    used : (m,) bool. parallax : (m,) m, σ of the shifts along the base, ∞ where there is none.
    point : (3,), covariance : (3, 3). numbers : (4,) see `VTPV` and the following.
    """

    shifts: np.ndarray
    used: np.ndarray
    parallax: np.ndarray
    point: np.ndarray
    covariance: np.ndarray
    numbers: np.ndarray


VTPV, REDUNDANCY, LEAST_CORRELATION, SIGMA_POSTS = 0, 1, 2, 3
"""Places in `Measured.numbers`: vᵀPv, redundancy, lowest correlation of a ray, σ of the parallax in posts."""


@kernel
def make_rooms(posts, search_steps, strip_steps, photographs):
    """Room for windows of so many posts, profiles of so many heights, and so many photographs of a node."""
    n, m = posts, photographs
    search = SearchRoom(
        np.empty((n, n), np.float32), np.empty((n, n), np.float32), np.empty((4, 2)), np.zeros(6),
        np.empty(search_steps), np.empty(m),
    )  # fmt: skip
    strips = StripRoom(
        np.empty(n * (n + MOST_PLACES), np.float32), np.zeros((4, n + MOST_PLACES + LANES), np.float32),
        np.empty(MOST_PLACES, np.float32), np.empty((m, strip_steps)),
    )  # fmt: skip
    shifts = ShiftRoom(
        np.empty((n + 2, n + 2)), np.empty((n, n)), np.empty((UNKNOWNS, UNKNOWNS)), np.empty(2), np.empty(5),
        np.empty((4, 2)), np.zeros(6), np.empty((2, 4)), np.empty(UNKNOWNS), np.empty(5),
        np.empty((UNKNOWNS, UNKNOWNS)), np.empty((m, 2)), np.empty((m, 3)),
    )  # fmt: skip
    return Rooms(search, strips, shifts)
