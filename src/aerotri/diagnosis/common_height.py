"""The uncertainty that all heights share: what no residual shows.

A flat block flown at one height fits as well with a longer principal distance and lower ground. The σ of the block's
mean height tells how well the two are told apart, and the correlation with the principal distance where it comes from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import solve_sides
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor

SHARED_PART = 0.5
"""Share of the median σ of the heights from which on the mean height is worth a word."""
BOUND = 0.9
"""Correlation with a principal distance from which on the principal distance is named."""


@dataclass(frozen=True)
class CommonHeight:
    """σ of the mean height of all points, m, and the principal distance it hangs on most.

    sigma_focal_mm, correlation : of that principal distance; NaN where none is estimated.
    """

    sigma: float
    group: str
    sigma_focal_mm: float
    correlation: float

    def sentence(self, median_sigma: float) -> str:
        """What to tell the user; '' when the heights are held. `median_sigma` m, the median σ of the heights."""
        if abs(self.correlation) > BOUND and self.sigma > SHARED_PART * median_sigma:
            return (
                f"all heights share an uncertainty of {self.sigma:.3f} m that no residual shows: it is that of the "
                f"principal distance of {self.group} (σ {self.sigma_focal_mm:.4f} mm, correlation "
                f"{100.0 * self.correlation:.1f} %). Height control, or a principal distance known better, reduces it"
            )
        return ""


def common_height(system: NormalSystem, solution: Solution, factor: Factor, sigma0: float) -> CommonHeight | None:
    """The shared uncertainty of the heights; None in a minimal or inner datum, where it has no meaning, and where all
    heights are held.

    One solution with the factor: the mean height is a linear function of the unknowns.
    """
    u = system.unknowns
    if u.block.settings.adjustment.datum != "control" or not len(u.points):
        return None
    sides = np.zeros((len(u.points), 3, 1))
    sides[:, 2] = 1.0 / len(u.points)
    _, shared, points = solve_sides(system, solution.state, factor, sides, solution.estimator)
    variance_of_mean = float(np.mean(points[:, 2, 0]))
    if not variance_of_mean > 0.0:
        # all heights are held
        return None
    sigma = float(np.sqrt(variance_of_mean))
    focal = [k for k, name in enumerate(u.shared.names) if name == "focal_length_mm"]
    if not focal:
        return CommonHeight(sigma0 * sigma, "", np.nan, 0.0)
    columns = 6 * len(u.images) + np.array(focal)
    variance = factor.columns(columns)[columns].diagonal()
    correlation = shared[focal, 0] / (sigma * np.sqrt(variance))
    worst = int(np.argmax(np.abs(correlation)))
    return CommonHeight(
        sigma=sigma0 * sigma,
        group=u.shared.groups[focal[worst]],
        sigma_focal_mm=sigma0 * float(np.sqrt(variance[worst])),
        correlation=float(correlation[worst]),
    )
