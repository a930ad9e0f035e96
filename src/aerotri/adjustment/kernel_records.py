"""What kernels are given, by name: the rays, what is estimated of them, where the unknowns stand, room to work in.

m rays lie in point order and, within a point, by photograph; P points, n photographs, L sets of interior elements, s
shared parameters.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled_records import record


@record
class RayArrays(NamedTuple):
    """The rays.

    Parameters
    ----------
    start : (P + 1,) first ray of every point.
    image : (m,) photograph. lens_row : (m,) set of interior elements.
    xy : (m, 2) mm, as measured. at : (m, 2) mm, where parameters of the measured position are evaluated.
    inv_sigma : (m, 2) 1/mm.
    ap_index : (m, ka) shared parameters that act on the ray as additional parameters.
    ap_value : (m, 2, ka) their partials.
    """

    start: np.ndarray
    image: np.ndarray
    lens_row: np.ndarray
    xy: np.ndarray
    at: np.ndarray
    inv_sigma: np.ndarray
    ap_index: np.ndarray
    ap_value: np.ndarray


@record
class Pairs(NamedTuple):
    """The blocks of pairs of photographs: `start` (P + 1,) first pair of every point, `block` its number, 32 bits.

    Of two rays of a point the photograph of the first has the smaller number.
    """

    start: np.ndarray
    block: np.ndarray


@record
class PairedRays(NamedTuple):
    """Rays to be paired: `start` and `image` of `RayArrays`, and where each stands.

    Parameters
    ----------
    point : (m,) of every ray. pair_start : (P + 1,) first pair of rays of every point.
    by_image : (m,) the rays in order of their photographs. first_ray : (n + 1,) first of every photograph there.
    """

    start: np.ndarray
    image: np.ndarray
    point: np.ndarray
    pair_start: np.ndarray
    by_image: np.ndarray
    first_ray: np.ndarray


@record
class Table(NamedTuple):
    """What is estimated.

    Parameters
    ----------
    lens_columns : (L, 0), (L, 15) or (L, 24), as `linearise_ray` needs, shared parameter of every interior element, −1
        where it is none.
    eo_free : (n, 6) 1 or 0.
    turn : (n, 3, 3) basis of the small rotations; (0, 3, 3) where it is the identity for all.
    kept : (P,) first shared parameter of a point that is not eliminated, −1 otherwise.
    """

    lens_columns: np.ndarray
    eo_free: np.ndarray
    turn: np.ndarray
    kept: np.ndarray


@record
class Scans(NamedTuple):
    """Photographs whose rows are exposed one after the other; arrays of length 0 where there is none.

    Parameters
    ----------
    rate : (n, 2) s per ms and mm: a ray at (x, y) is exposed rate·(x, y)·readout after the middle of the readout.
    readout : (n,) ms. velocity : (n, 3) m/s and spin : (n, 3) rad/s, both in the camera frame.
    columns : (n, 3) shared parameter of the readout time, and the first of three of velocity and of spin; −1 none.
    """

    rate: np.ndarray
    readout: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    columns: np.ndarray


@record
class Values(NamedTuple):
    """Where the unknowns but the points stand: rotation (n, 3, 3), centre (n, 3), interior (L, 24), shared (s,).

    scans : what photographs of rolling shutters do while they are read.
    """

    rotation: np.ndarray
    centre: np.ndarray
    interior: np.ndarray
    shared: np.ndarray
    scans: Scans


@record
class Points(NamedTuple):
    """The points: where they stand and what is known of them beforehand.

    Parameters
    ----------
    xyz, prior_xyz : (P, 3) m. prior_weight : (P, 3) 1/m², 0 where nothing is known. free : (P, 3) 1 or 0.
    """

    xyz: np.ndarray
    prior_xyz: np.ndarray
    prior_weight: np.ndarray
    free: np.ndarray


@record
class Weighting(NamedTuple):
    """How rays are weighted, and the residuals and weights that they get.

    Parameters
    ----------
    estimator, limit : code and limit of the robust estimator.
    residual : (m, 2) mm, out. weight : (m,) out.
    """

    estimator: int
    limit: float
    residual: np.ndarray
    weight: np.ndarray


@record
class Problem(NamedTuple):
    """All that the equations of a point depend on.

    Kernels take the parts out before their loops: taken out inside, each costs a hundred nanoseconds a point.
    damping : λ, every diagonal element is multiplied by 1 + λ.
    """

    rays: RayArrays
    pairs: Pairs
    table: Table
    values: Values
    points: Points
    weighting: Weighting
    damping: float


@record
class Work(NamedTuple):
    """Room of one thread for one point of up to q rays, see `_point_kernels.scratch`.

    Parameters
    ----------
    by_eo, by_pt, by_sh : (q, 2, ·) whitened partials by orientation, point and shared parameters.
    whitened : (q, 2) misclosures over σ.
    columns, n_columns : (q, ·) shared parameters of every ray, and how many; places in `union`.
    union, place : (s,) the shared parameters of the point, and where each stands among them.
    couple, couple_shared : (q, 3, 6) and (3, s), L⁻¹·N_pe and L⁻¹·N_ps.
    by_interior, prediction : (2, 24) and (2,) of one ray.
    moved, turned : (3,) and (3, 3), projection centre and rotation of one ray of a rolling shutter.
    """

    by_eo: np.ndarray
    by_pt: np.ndarray
    by_sh: np.ndarray
    whitened: np.ndarray
    columns: np.ndarray
    n_columns: np.ndarray
    union: np.ndarray
    place: np.ndarray
    couple: np.ndarray
    couple_shared: np.ndarray
    by_interior: np.ndarray
    prediction: np.ndarray
    moved: np.ndarray
    turned: np.ndarray


@record
class Places(NamedTuple):
    """Where a range of points adds up: the row of `Sums` of every photograph `image` (n,) and block `block` (nb,)."""

    image: np.ndarray
    block: np.ndarray


@record
class Sums(NamedTuple):
    """Normal equations of a range of points; rows of photographs and blocks as `Places` says.

    Parameters
    ----------
    blocks : (·, 6, 6), those of the photographs themselves first. border : (·, s, 6). corner : (s, s), of which each
        element is added on one side of the diagonal, whichever. right : (·, 6). right_shared : (s,).
    squares, squares_shared : (·, 6) and (s,) of the columns, before the points are eliminated.
    """

    blocks: np.ndarray
    border: np.ndarray
    corner: np.ndarray
    right: np.ndarray
    right_shared: np.ndarray
    squares: np.ndarray
    squares_shared: np.ndarray


@record
class Directions(NamedTuple):
    """Steps, right sides or solutions: images (n, 6, ·), shared (s, ·), points (P, 3, ·)."""

    images: np.ndarray
    shared: np.ndarray
    points: np.ndarray


@record
class Inverse(NamedTuple):
    """The inverse on the pattern of the reduced normal matrix: blocks (nb, 6, 6), border (n, s, 6), corner (s, s)."""

    blocks: np.ndarray
    border: np.ndarray
    corner: np.ndarray


@record
class Elimination(NamedTuple):
    """Of one point: lower (3, 3), the Cholesky factor L of its normals, and misclosure (3,), L⁻¹·(right side)."""

    lower: np.ndarray
    misclosure: np.ndarray


@record
class Pattern(NamedTuple):
    """Which photographs see a point: the rays' `start` and `image`, and the pairs of photographs; see above."""

    start: np.ndarray
    image: np.ndarray
    pair_start: np.ndarray
    pair_block: np.ndarray


@record
class Coupling(NamedTuple):
    """Of one point: H transposed over its photographs (q, 3, 6), H over shared parameters (s, 3), and Q_pp (3, 3)."""

    h: np.ndarray
    h_shared: np.ndarray
    q_pp: np.ndarray


@record
class Datum(NamedTuple):
    """The S-transformation to an inner datum of d motions: G and the columns Q·Aᵀ; d = 0 in other datums.

    images, qa_images : (n, 6, d). shared, qa_shared : (s, d). points, qa_points : (P, 3, d).
    """

    images: np.ndarray
    shared: np.ndarray
    points: np.ndarray
    qa_images: np.ndarray
    qa_shared: np.ndarray
    qa_points: np.ndarray


@record
class Scale(NamedTuple):
    """What effects are measured by.

    Parameters
    ----------
    to_angles : (n, 3, 3) from the rotation unknowns to ω, φ, κ.
    per_image, per_shared, per_point : 1/σ (n, 6), (s,), (P, 3), 0 for an unknown that is held.
    """

    to_angles: np.ndarray
    per_image: np.ndarray
    per_shared: np.ndarray
    per_point: np.ndarray


@record
class Effects(NamedTuple):
    """Of every ray, out: size (m, 2) of the largest effect over σ, which unknown (m, 2), height (m, 2) m.

    Unknowns: 0–2 of the point, 3–8 of the photograph, from 9 on a shared parameter, −1 none.
    """

    size: np.ndarray
    unknown: np.ndarray
    height: np.ndarray


@record
class RowPlace(NamedTuple):
    """One coordinate of a ray: the ray's number within its point, 0 for x or 1 for y, the point, the photograph."""

    q: int
    row: int
    point: int
    image: int


@record
class FrontBlocks(NamedTuple):
    """The matrix blocks that begin in a front, and their places there; see `sparse_cholesky`."""

    block: np.ndarray
    local_row: np.ndarray
    local_col: np.ndarray
    flipped: np.ndarray


@record
class MatrixBlocks(NamedTuple):
    """Blocks (nb, 6, 6) of a matrix, their photographs, and the scale (n, 6) of its rows and columns."""

    blocks: np.ndarray
    row: np.ndarray
    col: np.ndarray
    scale: np.ndarray


@record
class Front(NamedTuple):
    """A dense front: its two flat panels in Fortran order, and how many rows each has."""

    own: int
    rows: int
    top: np.ndarray
    low: np.ndarray
