"""A forward lens: distortion as a function of the ideal direction, as OpenCV, COLMAP and Metashape have it.

[L] With a, b the ideal position for c = 1 and ρ² = a² + b²:

R = (1 + k1ρ² + k2ρ⁴ + k3ρ⁶ + k4ρ⁸)/(1 + q1ρ² + q2ρ⁴ + q3ρ⁶),
a' = aR + 2p1ab + p2(ρ² + 2a²) + sx·ρ², b' = bR + p1(ρ² + 2b²) + 2p2ab + sy·ρ²,
x = c·(a' + b1a' + b2b') + x0, y = c·b' + y0.

Of a perspective camera (a, b) = (−u1/u3, −u2/u3), of a fisheye (a, b) = θ/r·(u1, u2) with r² = u1² + u2² and the angle
θ = atan2(r, −u3) to the axis: the radial terms are then those of OpenCV's fisheye, θ + k1θ³ + … + k4θ⁹.

It stands beside Brown's parameters because the two models are inverse to each other only approximately: a block from
those programs is adjusted in its own model, without a fit in between.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from aerotri.functional_model.additional_parameters.family import NO_UNIT, Family
from aerotri.observations import Camera
from aerotri.observations.block import LENS_NAMES

ITEMS = LENS_NAMES
COLUMNS = (*ITEMS, "fisheye")
"""What a vector of lens parameters holds: the items, and 1 for a fisheye, 0 for a perspective camera."""
FISHEYE = len(ITEMS)
DESCRIPTION = {
    "k1": "radial ρ³ of the ideal direction",
    "k2": "radial ρ⁵ of the ideal direction",
    "p1": "decentring along y",
    "p2": "decentring along x",
    "k3": "radial ρ⁷ of the ideal direction",
    "k4": "radial ρ⁹ of the ideal direction, Metashape's k4",
    "q1": "denominator ρ², OpenCV's and COLMAP's k4",
    "q2": "denominator ρ⁴, OpenCV's and COLMAP's k5",
    "q3": "denominator ρ⁶, OpenCV's and COLMAP's k6",
    "sx": "thin prism ρ² along x",
    "sy": "thin prism ρ² along y",
    "b1": "affinity, scale of x after the distortion",
    "b2": "affinity, shear of x after the distortion",
}
ROUNDS = 40
"""Newton steps at most [C]: a few suffice; the bound ends positions that no direction has."""
TOLERANCE = 1e-15
"""Square of the last step [C]: a step of 3·10⁻⁸ leaves its square, 10⁻¹⁵, to the next."""
CHECKS = 8
"""Places between the axis and a direction where the distortion must not fold [C]."""
SMALL = 1e-4
"""Square of tan θ below which series replace quotients of small numbers: their next terms are below 10⁻¹⁶ [D]."""


def vector(values: Mapping[str, float], fisheye: bool = False) -> np.ndarray:
    """(14,) values by name in the order of `COLUMNS`; 0 for what is not named."""
    return np.array([*(values.get(name, 0.0) for name in ITEMS), float(fisheye)])


def vector_of(camera: Camera) -> np.ndarray:
    """(14,) the lens as a camera states it, in the order of `COLUMNS`."""
    return vector({name: prior.value for name, prior in camera.lens.items()}, camera.is_fisheye)


def distort(a: np.ndarray, b: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """Distorted positions of ideal directions, for c = 1.

    Parameters
    ----------
    a, b : (n,) tangents of the ideal direction.
    parameters : (14,) in the order of `COLUMNS`.

    Returns
    -------
    (n, 2).
    """
    if parameters[FISHEYE]:
        scale = _angle_by_tangent(a * a + b * b)
        a, b = a * scale, b * scale
    return bend(a, b, parameters)


def bend(a: np.ndarray, b: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """(n, 2) distorted positions of ideal positions (n,) for c = 1, in the camera's own projection."""
    a_bent, b_bent = _bent(a, b, parameters)
    b1, b2 = parameters[11:13]
    return np.stack([(1.0 + b1) * a_bent + b2 * b_bent, b_bent], axis=-1)


def undistort(distorted: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """Tangents of ideal directions: the inverse of `distort`.

    Parameters
    ----------
    distorted : (n, 2) for c = 1.
    parameters : (14,) in the order of `COLUMNS`.

    Returns
    -------
    (n, 2), NaN where no direction in front of the camera is recorded there.
    """
    ideal = unbend(distorted, parameters)
    if not parameters[FISHEYE]:
        return ideal
    theta = np.hypot(ideal[:, 0], ideal[:, 1])
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = np.where(theta < 1e-3, 1.0 + theta**2 / 3.0 + 2.0 * theta**4 / 15.0, np.tan(theta) / theta)
        return ideal * np.where(theta < np.pi / 2.0, scale, np.nan)[:, None]


def unbend(distorted: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """Ideal positions in the camera's own projection: the inverse of `bend`, by Newton's method.

    Returns
    -------
    (n, 2), NaN where there is none on the branch that begins at the axis.
    """
    distorted = np.asarray(distorted, dtype=float)
    if not parameters[:FISHEYE].any():
        return distorted.copy()
    ideal, active = distorted.copy(), np.arange(len(distorted))
    with np.errstate(all="ignore"):
        for _ in range(ROUNDS):
            a, b = ideal[active].T
            gap = distorted[active] - bend(a, b, parameters)
            step = _solved(slopes(a, b, parameters), gap)
            ideal[active] += step
            active = active[~(np.sum(step**2, axis=1) < TOLERANCE * (1.0 + np.sum(ideal[active] ** 2, axis=1)))]
            if not len(active):
                break
        ideal[active] = np.nan
        ideal[~_unfolded(ideal, parameters)] = np.nan
    return ideal


def slopes(a: np.ndarray, b: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """(n, 2, 2) partials of `bend` by a and b."""
    _, _, p1, p2, _, _, _, _, _, sx, sy, b1, b2 = parameters[:FISHEYE]
    radial, slope, _ = _radial(a * a + b * b, parameters)
    mixed = a * b * slope + 2.0 * (p1 * a + p2 * b)
    aa, ab = radial + a * a * slope + 2.0 * p1 * b + (6.0 * p2 + 2.0 * sx) * a, mixed + 2.0 * sx * b
    ba, bb = mixed + 2.0 * sy * a, radial + b * b * slope + (6.0 * p1 + 2.0 * sy) * b + 2.0 * p2 * a
    rows = [[(1.0 + b1) * aa + b2 * ba, (1.0 + b1) * ab + b2 * bb], [ba, bb]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def patterns(a: np.ndarray, b: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """(n, 2, 13) partials of `bend` by the items, a and b (n,) held."""
    rho2 = a * a + b * b
    radial, _, below = _radial(rho2, parameters)
    a_bent, b_bent = _bent(a, b, parameters)
    zero, (b1, b2) = np.zeros_like(rho2), parameters[11:13]
    up, down = [rho2**n / below for n in (1, 2, 3, 4)], [-radial * rho2**n / below for n in (1, 2, 3)]
    by_a = [
        a * up[0], a * up[1], 2.0 * a * b, rho2 + 2.0 * a * a, a * up[2], a * up[3], *(a * d for d in down), rho2, zero,
    ]  # fmt: skip
    by_b = [
        b * up[0], b * up[1], rho2 + 2.0 * b * b, 2.0 * a * b, b * up[2], b * up[3], *(b * d for d in down), zero, rho2,
    ]  # fmt: skip
    x = [(1.0 + b1) * i + b2 * j for i, j in zip(by_a, by_b, strict=True)]
    return np.stack([np.stack([*x, a_bent, b_bent], axis=-1), np.stack([*by_b, zero, zero], axis=-1)], axis=1)


def _bent(a: np.ndarray, b: np.ndarray, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """a', b' before the affinity."""
    _, _, p1, p2, _, _, _, _, _, sx, sy, _, _ = parameters[:FISHEYE]
    rho2 = a * a + b * b
    radial = _radial(rho2, parameters)[0]
    return (
        a * radial + 2.0 * p1 * a * b + p2 * (rho2 + 2.0 * a * a) + sx * rho2,
        b * radial + p1 * (rho2 + 2.0 * b * b) + 2.0 * p2 * a * b + sy * rho2,
    )


def _radial(rho2: np.ndarray, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The quotient R, twice its derivative by ρ², and its denominator."""
    k1, k2, _, _, k3, k4, q1, q2, q3 = parameters[:9]
    below = 1.0 + rho2 * (q1 + rho2 * (q2 + rho2 * q3))
    radial = (1.0 + rho2 * (k1 + rho2 * (k2 + rho2 * (k3 + rho2 * k4)))) / below
    up = k1 + rho2 * (2.0 * k2 + rho2 * (3.0 * k3 + 4.0 * rho2 * k4))
    down = q1 + rho2 * (2.0 * q2 + 3.0 * rho2 * q3)
    return radial, 2.0 * (up - radial * down) / below, below


def _angle_by_tangent(tangent2: np.ndarray) -> np.ndarray:
    """θ/tan θ for tan²θ."""
    tangent = np.sqrt(tangent2)
    series = 1.0 - tangent2 * (1.0 / 3.0 - tangent2 * (0.2 - tangent2 / 7.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(tangent2 < SMALL, series, np.arctan(tangent) / tangent)


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """(n, 2) solutions of (n, 2, 2) with right sides (n, 2), not finite where there is none."""
    (aa, ab), (ba, bb) = np.moveaxis(matrix, 0, -1)
    x, y = right.T
    return np.stack([bb * x - ab * y, aa * y - ba * x], axis=-1) / (aa * bb - ab * ba)[:, None]


def _unfolded(ideal: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """(n,) bool: neighbours keep their places all the way from the axis."""
    kept = np.asarray(np.isfinite(ideal).all(axis=1))
    for part in np.arange(1, CHECKS + 1) / CHECKS:
        a, b = part * ideal.T
        (aa, ab), (ba, bb) = np.moveaxis(slopes(a, b, parameters), 0, -1)
        kept &= aa * bb - ab * ba > 0.0
        kept &= _radial(a * a + b * b, parameters)[2] > 0.0
    return kept


FAMILY = Family(
    name="lens",
    items=ITEMS,
    default_items=("k1", "k2", "p1", "p2", "k3"),
    mark="L",
    reference="OpenCV calib3d; COLMAP; Metashape; Agarwal et al., Bundle Adjustment in the Large (2010)",
    text=DESCRIPTION.__getitem__,
    unit=lambda _: NO_UNIT,
)
