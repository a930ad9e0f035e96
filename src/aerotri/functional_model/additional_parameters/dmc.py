"""The special additional parameters of BLUH for the DMC: four tilted heads, one quadrant of the image each.

[P] the list, 34–41 and the form of 30–33 (Spreckels et al., Table 1); [D] the meaning of 30–33, 74–77, 79, 80 and 29;
[C] the numbering: quadrants counter-clockwise from x > 0, y > 0. Native frame: x across, y along the flight, raw
millimetres; `flight_axis` turns it into the image.

30–33  synchronisation: a shutter delay acts along the flight, d_y = P·(y² − 32·|y|).
34–41  orientation of a head: −x·y·P in x (even numbers) or in y (odd numbers).
74–77  radial in a head: −J_H·(ξ, η)·((s_H·ρ)² − 16384)·P, s_H = 162.6 mm / 49.53 mm.
79     butterfly: a common change of the heads' focal lengths, less what the stitching and the orientation absorb.
80     one radial parameter for all heads, the sum of 74–77, hence never together with them.
29     offset of the heads' projection centres: depends on the heights of the points, see `centre_offset`; 0 at the mean
       ground, as a pattern of the image.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import dmc_heads as heads
from aerotri.functional_model.additional_parameters.bluh import NORMAL_R_MAX, ZERO_RADIUS_SQUARED
from aerotri.functional_model.additional_parameters.family import NO_UNIT, Family, per_mm
from aerotri.functional_model.additional_parameters.native_frame import native_from_image, native_half_format_mm
from aerotri.functional_model.additional_parameters.terms import Terms, dense_terms, only, turned
from aerotri.observations import Camera

SYNCHRONISATION = tuple(str(i) for i in range(30, 34))
"""Parameters 30–33, one for each head [P]."""
ORIENTATION = tuple(str(i) for i in range(34, 42))
"""Parameters 34–41, x and y of each head [P]."""
RADIAL = tuple(str(i) for i in range(74, 78))
"""Parameters 74–77, one for each head [P]."""
ITEMS = (*SYNCHRONISATION, *ORIENTATION, *RADIAL, "79", "80")
DEFAULT_ITEMS = ITEMS[:-1]
"""Without 80, which is the sum of 74–77."""
NEEDS_HEIGHT = ("29",)
KNOWN = (*ITEMS, *NEEDS_HEIGHT)
MARKS = {item: "P" for item in ORIENTATION} | {item: "D" for item in (*RADIAL, "79", "80", *NEEDS_HEIGHT)}
QUADRANT_NAMES = ("upper right", "upper left", "lower left", "lower right")
DESCRIPTION = {
    **{item: f"synchronisation, {name} head" for item, name in zip(SYNCHRONISATION, QUADRANT_NAMES, strict=True)},
    **{
        item: f"orientation error {'xy'[k % 2]}, {QUADRANT_NAMES[k // 2]} head"
        for k, item in enumerate(ORIENTATION)
    },
    **{item: f"radial symmetric, {name} head" for item, name in zip(RADIAL, QUADRANT_NAMES, strict=True)},
    "79": "butterfly, focal length of the heads",
    "80": "radial symmetric, common to all heads",
    "29": "offset of the heads' projection centres, by height",
}  # fmt: skip
"""What every parameter corrects, in words of a report."""

UNITS = {
    **dict.fromkeys((*SYNCHRONISATION, *ORIENTATION), per_mm(1)), **dict.fromkeys((*RADIAL, "80"), per_mm(2)),
    **dict.fromkeys(NEEDS_HEIGHT, "m"),
}  # fmt: skip
"""Of the parameters; 79 has none."""
ZERO_ALONG_MM = 32.0
"""mm along the flight at which the pattern of 30–33 is zero again: y² − 32·|y| [P]."""
HEAD_SCALE = NORMAL_R_MAX / float(np.hypot(*heads.HALF_FORMAT_MM))
SEAM_POINTS = 41
"""Points along a seam in which the two heads have to meet [D]: the mismatch is smooth, so that their number changes
little."""
ORIENTATION_GRID = (61, 41)
"""Points across and along over which the orientation is taken off [D]: square cells, dense enough for a smooth
pattern."""


def check_items(items: Sequence[str]) -> None:
    """Refuse 80 together with any of 74–77."""
    both = [item for item in RADIAL if item in items]
    if "80" in items and both:
        raise InputError(
            f"dmc.80 stands for the sum of dmc.74 to dmc.77 and excludes them, dmc.{both[0]} is chosen too",
            "leave out 80, or 74-77",
        )


def quadrant_of(x_native: np.ndarray, y_native: np.ndarray) -> np.ndarray:
    """(n,) quadrant 0–3 of native positions, counter-clockwise from x ≥ 0, y ≥ 0."""
    return np.where(y_native >= 0.0, np.where(x_native >= 0.0, 0, 1), np.where(x_native >= 0.0, 3, 2))


def synchronisation(native: np.ndarray, partials: bool = False) -> tuple[np.ndarray, np.ndarray | None]:
    """Pattern of 30–33, (n, 2), and its partials (n, 2, 2) by x and y; native frame, every quadrant alike."""
    y = native[:, 1]
    value = np.zeros_like(native)
    value[:, 1] = y**2 - ZERO_ALONG_MM * np.abs(y)
    if not partials:
        return value, None
    partial = np.zeros((len(y), 2, 2))
    partial[:, 1, 1] = 2.0 * y - np.where(y >= 0.0, ZERO_ALONG_MM, -ZERO_ALONG_MM)
    return value, partial


def orientation(native: np.ndarray, axis: int, partials: bool = False) -> tuple[np.ndarray, np.ndarray | None]:
    """Pattern of 34–41, −x·y along one axis, and its partials; native frame, every quadrant alike."""
    value = np.zeros_like(native)
    value[:, axis] = -native[:, 0] * native[:, 1]
    if not partials:
        return value, None
    partial = np.zeros((len(native), 2, 2))
    partial[:, axis] = -native[:, ::-1]
    return value, partial


def radial(xi_eta: np.ndarray, f: float, partials: bool = False) -> tuple[np.ndarray, np.ndarray | None]:
    """Pattern of 74–77 in the upper right quadrant, (n, 2), and its partials (n, 2, 2) by x and y.

    Parameters
    ----------
    xi_eta : (n, 2) mm in the plane of the head; f : mm.
    """
    factor = HEAD_SCALE**2 * np.sum(xi_eta**2, axis=1) - ZERO_RADIUS_SQUARED
    if not partials:
        return heads.carried(xi_eta, f, -factor[:, None] * xi_eta)
    slope = -2.0 * HEAD_SCALE**2 * xi_eta[:, :, None] * xi_eta[:, None, :] - factor[:, None, None] * np.eye(2)
    return heads.carried(xi_eta, f, -factor[:, None] * xi_eta, slope)


@lru_cache(maxsize=16)
def stitching(f: float, half_across: float, half_along: float) -> tuple[float, float, float]:
    """Rotations ω of a head, per unit of relative change of its focal length, that close the seams best.

    Least squares of dx(0, y) = 0 and dy(x, 0) = 0 in 41 points of each seam of the upper right quadrant: what is
    perpendicular to a seam has the opposite sign on its other side.
    """
    along_seams, zero = np.linspace(0.0, 1.0, SEAM_POINTS), np.zeros(SEAM_POINTS)
    design, right = [], []
    for x, y, component in ((zero, along_seams * half_along, 0), (along_seams * half_across, zero, 1)):
        xi_eta = heads.in_head(x, y, f)
        j = heads.jacobian(xi_eta, f)
        design.append((j @ heads.turning(xi_eta, f))[:, component])
        right.append(np.einsum("nab,nb->na", j, xi_eta)[:, component])
    omega = np.linalg.lstsq(np.concatenate(design), np.concatenate(right), rcond=None)[0]
    return float(omega[0]), float(omega[1]), float(omega[2])


def stitched_focal_change(
    xi_eta: np.ndarray, f: float, omega: Sequence[float], partials: bool = False
) -> tuple[np.ndarray, np.ndarray | None]:
    """J_H·(ξ, η) − Σ ω_k·J_H·g_k in the upper right quadrant, (n, 2), and its partials (n, 2, 2)."""
    turn = np.array(omega)
    slope = np.eye(2) - np.einsum("nakb,k->nab", heads.turning_slope(xi_eta, f), turn) if partials else None
    return heads.carried(xi_eta, f, xi_eta - heads.turning(xi_eta, f) @ turn, slope)


@lru_cache(maxsize=16)
def scale_in_butterfly(f: float, half_across: float, half_along: float) -> float:
    """The change of scale in `stitched_focal_change`, least squares over the format.

    The pattern is its own mirror image about both axes, so that of the six orientation columns over flat ground only
    the scale (x, y) has a part in it.
    """
    nx, ny = ORIENTATION_GRID
    across, along = np.linspace(-half_across, half_across, nx), np.linspace(-half_along, half_along, ny)
    x, y = (np.abs(g.ravel()) for g in np.meshgrid(across, along))
    omega = stitching(f, half_across, half_along)
    pattern, _ = stitched_focal_change(heads.in_head(x, y, f), f, omega)
    return float(np.sum(pattern * np.column_stack([x, y])) / np.sum(x**2 + y**2))


def butterfly(
    camera: Camera, folded: np.ndarray, xi_eta: np.ndarray, partials: bool = False
) -> tuple[np.ndarray, np.ndarray | None]:
    """Pattern of 79 in the upper right quadrant, (n, 2) mm per unit of relative change, and its partials (n, 2, 2).

    Parameters
    ----------
    folded, xi_eta : (n, 2) mm in the virtual image and in the plane of the head.
    """
    f, half = camera.focal_length_mm, native_half_format_mm(camera)
    value, partial = stitched_focal_change(xi_eta, f, stitching(f, *half), partials)
    scale = scale_in_butterfly(f, *half)
    return value - scale * folded, None if partial is None else partial - scale * np.eye(2)


Column = tuple[np.ndarray, np.ndarray, np.ndarray | None]
"""Index within `ITEMS` (n,), value (n, 2) and partials (n, 2, 2) of a column, native frame."""


def _columns(camera: Camera, native: np.ndarray, items: Sequence[str], partials: bool) -> Iterator[Column]:
    """The columns that act, those of a group of items only where one of them is asked for."""
    quadrant, wanted = quadrant_of(native[:, 0], native[:, 1]), set(items)
    if wanted.intersection(SYNCHRONISATION):
        yield _index("30", quadrant), *synchronisation(native, partials)
    for axis in (0, 1):
        if wanted.intersection(ORIENTATION[axis::2]):
            yield _index("34", 2 * quadrant + axis), *orientation(native, axis, partials)
    if not wanted.intersection((*RADIAL, "79", "80")):
        return
    f, folded = camera.focal_length_mm, np.abs(native)
    sign = np.where(native >= 0.0, 1.0, -1.0)
    xi_eta = heads.in_head(folded[:, 0], folded[:, 1], f)
    if wanted.intersection((*RADIAL, "80")):
        pattern = _mirrored(sign, *radial(xi_eta, f, partials))
        if wanted.intersection(RADIAL):
            yield _index("74", quadrant), *pattern
        if "80" in wanted:
            yield _index("80", 0 * quadrant), *pattern
    if "79" in wanted:
        yield _index("79", 0 * quadrant), *_mirrored(sign, *butterfly(camera, folded, xi_eta, partials))


def _index(first: str, offset: np.ndarray) -> np.ndarray:
    return ITEMS.index(first) + offset


def _mirrored(sign: np.ndarray, value: np.ndarray, partial: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
    """A pattern of the upper right quadrant in the quadrants with these signs (n, 2)."""
    return sign * value, None if partial is None else sign[:, :, None] * sign[:, None, :] * partial


def _evaluate(camera: Camera, x: np.ndarray, y: np.ndarray, partials: bool, items: tuple[str, ...]) -> Terms:
    """Patterns of the head each point lies in, and 79 and 80; up to six columns."""
    turn = native_from_image(camera)
    columns = list(_columns(camera, np.stack([x, y], axis=-1) @ turn.T, items, partials))
    if not columns:
        return dense_terms(x, y, 0, partials, lambda x, y, value, partial: None)
    index = np.stack([column[0] for column in columns], axis=1)
    value = np.stack([column[1] for column in columns], axis=2)
    partial = np.stack([column[2] for column in columns if column[2] is not None], axis=2) if partials else None
    return turned(only(Terms(index, value, partial), KNOWN, items), turn)


def centre_offset(camera: Camera, x: np.ndarray, y: np.ndarray, height: np.ndarray, above: np.ndarray) -> np.ndarray:
    """Pattern of 29, the offset of the heads' projection centres: dx = −f·dX·ΔH/(h0·(h0 − ΔH)), dX = sx; dy alike.

    Zero at the mean height of the block, for which the virtual image is made. It needs the heights of the points and
    stands outside the patterns of the image.

    Parameters
    ----------
    x, y : (n,) mm from the image centre.
    height : (n,) m, flying height h0 above the mean ground of the block.
    above : (n,) m, height ΔH of the point above the mean ground.

    Returns
    -------
    (n, 2) mm per metre of P29.
    """
    turn = native_from_image(camera)
    native = np.stack([x, y], axis=-1) @ turn.T
    size = -camera.focal_length_mm * above / (height * (height - above))
    return size[:, None] * np.where(native >= 0.0, 1.0, -1.0) @ turn


FAMILY = Family(
    name="dmc",
    items=ITEMS,
    mark="PD",
    reference="Spreckels, Schlienkamp, Jacobsen, Table 1 (30–41, 74–77, 79, 80); head geometry of this project",
    text=DESCRIPTION.__getitem__,
    unit=lambda item: UNITS.get(item, NO_UNIT),
    evaluate=_evaluate,
    camera_model="dmc",
    default_items=DEFAULT_ITEMS,
    marks=MARKS,
    check_items=check_items,
    needs_height=NEEDS_HEIGHT,
    at_heights=centre_offset,
)
