"""How accurate a volume will be, before the flight: Kubik's results on strips and blocks (paper 001), repaired.

The error model of the paper: the heights of the nadir points of a strip are the double sum of independent transfer
errors, Z_(i−1) − 2Z_i + Z_(i+1) = e_i with σ0 each, and are known at every d-th point. σ0 is 0.2 ‰ of the flying
height H, the base b 0.6 H, the width of a strip 2b. What the paper prints [P] are variances span by span,
(d⁴ − 1)/(120 n), taken as d⁴/(120 n); its Result 2 is printed ten times too small (0.4e-5 for 3.93e-5). A joint
adjustment over all spans has a smaller variance [D], since the points known bind the spans together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

SIGMA0_SHARE, BASE_SHARE = 2e-4, 0.6
"""σ0 over H; base over H, wide angle."""
EDGE = {2: 0.707, 3: 1.277, 4: 1.701, 5: 2.000, 6: 2.209, 8: 2.463, 10: 2.600, 15: 2.752}
"""c_d of the joint adjustment: what the two free ends add [D]."""


def strip(d: float, n: float, sigma0: float = 1.0) -> float:
    """Result 1 [P]: σ of the mean height of a strip of n models with control every d models."""
    return float(np.sqrt(d**4 / (120.0 * n)) * sigma0)


def strip_exact(d: int, n: int, sigma0: float = 1.0) -> float:
    """Result 1 without its rounding [D]: every span adjusted on its own, variance (d⁴ − 1)/(120 n)."""
    return float(np.sqrt((d**4 - 1.0) / (120.0 * n)) * sigma0)


def strip_by_size(bridging_m: float, height_m: float, length_m: float) -> float:
    """Result 2 [D, printed ten times too small]: m, from bridging distance D, flying height H and strip length A, m.

    d = D/b, n = A/b: σ = 2e-4·H·√(b/(120 A))·D²/b² = 3.93e-5·D²/√(H·A).
    """
    base = BASE_SHARE * height_m
    return strip(bridging_m / base, length_m / base, SIGMA0_SHARE * height_m)


def free_strip(n: float, sigma0: float = 1.0) -> float:
    """Result 3 [P]: a free strip, control in its first model alone; asymptotic (0.967 of it at n = 5, .998 at 20)."""
    return float(np.sqrt(n**3 / 20.0) * sigma0)


def free_strip_exact(n: int, sigma0: float = 1.0) -> float:
    """Result 3 summed: Z_i = Σ_k Σ_(j≤k) e_j behind the two points of the first model, mean over the points 1 … n."""
    weight = np.array([(n - j) * (n - j + 1) / 2.0 for j in range(1, n)]) / n
    return float(np.sqrt(np.sum(weight**2)) * sigma0)


def block(d: float, n: float, m: float, sigma0: float = 1.0) -> float:
    """Result 4 [P]: a block of m strips of n models each."""
    return strip(d, n, sigma0) / float(np.sqrt(m))


def block_by_size(bridging_m: float, length_m: float, width_m: float) -> float:
    """Result 4 in sizes [P]: m, 4.30e-5·D²/√(A·B), independent of the flying height: m = B/2b strips."""
    height = 1000.0
    base = BASE_SHARE * height
    return block(bridging_m / base, length_m / base, width_m / (2.0 * base), SIGMA0_SHARE * height)


def joint(d: int, n: int, sigma0: float = 1.0) -> float:
    """σ of the mean height of a strip adjusted as a whole, by inverting the normal equations [D].

    n + 1 nadir points, every d-th known; σ0 of each second difference; the mean over the points 1 … n.
    """
    unknown = np.array([i for i in range(n + 1) if i % d], dtype=np.int64)
    if not len(unknown):
        return 0.0
    row = np.full(n + 1, -1)
    row[unknown] = np.arange(len(unknown))
    banded = np.zeros((3, len(unknown)))
    for i in range(1, n):
        part = [(row[i + k], c) for k, c in ((-1, 1.0), (0, -2.0), (1, 1.0)) if row[i + k] >= 0]
        for a, u in part:
            for b, v in part:
                if b >= a:
                    banded[2 - (b - a), b] += u * v
    weights = np.full(len(unknown), 1.0 / n)
    return float(np.sqrt(weights @ solveh_banded(banded, weights)) * sigma0)


def joint_fitted(d: int, n: int, sigma0: float = 1.0) -> float:
    """`joint` in closed form for n ≥ 4d and tabulated d [D]: variance (d² − 1)(d² + 11)/(720 n)·(1 + c_d·d/n)."""
    return float(np.sqrt((d**2 - 1.0) * (d**2 + 11.0) / (720.0 * n) * (1.0 + EDGE[d] * d / n)) * sigma0)


def joint_block(d: int, n: int, m: int, tie: float = 1.0, sigma0: float = 1.0) -> float:
    """σ of the mean height of a block of m strips tied side to side, by inverting its normal equations.

    Parameters
    ----------
    tie : weight of the equality of neighbouring strips' points, over that of a transfer error.
    """
    unknown = np.array([i for i in range(n + 1) if i % d], dtype=np.int64)
    if not len(unknown):
        return 0.0
    rows = []
    for i in range(1, n):
        row = np.zeros(n + 1)
        row[i - 1 : i + 2] = 1.0, -2.0, 1.0
        rows.append(row[unknown])
    of_strip = np.array(rows).T @ np.array(rows)
    sides = 2.0 * np.eye(m) - np.eye(m, k=1) - np.eye(m, k=-1)
    sides[0, 0] = sides[-1, -1] = 1.0 if m > 1 else 0.0
    normal = np.kron(np.eye(m), of_strip) + tie * np.kron(sides, np.eye(len(unknown)))
    weights = np.full(len(normal), 1.0 / (n * m))
    return float(np.sqrt(weights @ np.linalg.solve(normal, weights)) * sigma0)


@dataclass(frozen=True)
class Prediction:
    """σ of the mean height of an area, m, by every formula; and in m³.

    Parameters
    ----------
    d, n, m : models between control, models in a strip, strips. sigma0 : m.
    spanwise : Kubik's. joint : adjusted as a whole. free : without control but in the first model.
    area : m².
    """

    d: int
    n: int
    m: int
    sigma0: float
    spanwise: float
    joint: float
    free: float
    area: float


def predict_volume(
    height_m: float, length_m: float, width_m: float, bridging_m: float, sigma0_share: float = SIGMA0_SHARE,
    base_share: float = BASE_SHARE, strip_width_share: float = 2.0,
) -> Prediction:  # fmt: skip
    """The accuracy of a volume by the theory.

    Parameters
    ----------
    height_m : flying height. length_m, width_m : of the area. bridging_m : between control points along the strips.
    sigma0_share : σ of a height from one model, over the flying height. base_share : base over flying height.
    strip_width_share : width of a strip over the base.
    """
    base, sigma0 = base_share * height_m, sigma0_share * height_m
    d, n = max(1, round(bridging_m / base)), max(1, round(length_m / base))
    m = max(1, round(width_m / (strip_width_share * base)))
    n = max(n, d)
    return Prediction(
        d, n, m, sigma0, block(d, n, m, sigma0), joint(d, n, sigma0) / float(np.sqrt(m)), free_strip(n, sigma0),
        length_m * width_m,
    )  # fmt: skip
