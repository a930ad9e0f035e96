"""What additional parameters change at check points, from one adjustment: where the points go if they are left out.

[D] Holding parameters A at zero moves every other unknown by −Q_xA·Q_AA⁻¹·p_A: the same as adjusting without them, as
far as the equations are linear and robust weights stay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import solve_sides
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.functional_model.additional_parameters import Parameter
from aerotri.results.adjusted_block import AdjustedBlock

AT_ONCE = 48
"""Right sides solved together [C]: more need more memory, a row of each for every unknown; fewer go through the factor
more often."""
FEWEST_POINTS = 5
"""Check points from which a Student test is made [C]: of fewer the spread is so uncertain that hardly any change would
be found."""
NO_DIFFERENCE = "no difference"
INDIVIDUALLY = 60
"""Of a family with more parameters (nodes of a grid) none is left out on its own."""
CONFIDENCE = 0.99
"""Of the two-sided Student test whether a change at the check points is more than chance [C]."""
MATERIAL = 0.05
"""Share by which Σd²/σ² has to change besides [C]: neighbouring points move together, so that small changes of one sign
look surer to the test than they are."""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """The check points without some parameters.

    Parameters
    ----------
    label : 'all', a family such as 'bluh', or a parameter. group : of a parameter, '' otherwise.
    difference : (k, 3) m, adjusted − given without them.
    t : of a parameter, NaN otherwise.
    worse : mean over the points of the growth of d²/σ², over the standard deviation of this mean, NaN where there are
        too few points; beyond ± `limit` it is more than chance. share : by which Σd²/σ² grows.
    """

    label: str
    group: str
    difference: np.ndarray
    t: float
    worse: float
    limit: float
    share: float

    @property
    def verdict(self) -> str:
        """Whether the parameters help, do harm or make no difference at the check points."""
        if not np.isfinite(self.worse):
            return "too few check points"
        if abs(self.worse) <= self.limit or abs(self.share) <= MATERIAL:
            return NO_DIFFERENCE
        return "helps" if self.worse > 0.0 else "does harm"


@dataclass(frozen=True, eq=False)
class ParameterEffects:
    """The check points as adjusted, (k, 3) m, and with parameters left out: all, every family, every parameter."""

    difference: np.ndarray
    left_out: tuple[LeftOut, ...]


def rms_by_axis(difference: np.ndarray) -> np.ndarray:
    """(3,) m, RMS of differences (k, 3) m over the points that have the coordinate; NaN where none has."""
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.nansum(difference**2, axis=0) / np.isfinite(difference).sum(axis=0))


def parameter_effects(
    adjusted: AdjustedBlock, system: NormalSystem, solution: Solution, factor: Factor
) -> ParameterEffects | None:
    """What leaving parameters out would change at the check points.

    Parameters
    ----------
    adjusted : in the frame of the adjustment. factor : undamped, at the solution.

    Returns
    -------
    None where there are no check points or parameters, or where an inner datum moves with them.
    """
    p, u = adjusted.parameters, system.unknowns
    rows = np.flatnonzero((p.kinds == "additional") & np.isin(p.status, ("estimated", "weighted")) & (p.sigma > 0.0))
    if not len(rows) or not len(adjusted.check) or adjusted.block.settings.adjustment.datum == "inner":
        return None
    column_of = {key: k for k, key in enumerate(zip(u.shared.names, u.shared.groups, strict=True))}
    columns = np.array([column_of[str(p.names[row]), str(p.groups[row])] for row in rows])
    row = np.full(len(u.block.points), -1)
    row[u.points] = np.arange(len(u.points))
    at = row[adjusted.check.point]
    q_points, q = _cofactors(system, solution, factor, columns, at)
    value, d = p.value[rows], adjusted.check.difference
    variance = adjusted.check.sigma**2 + _given_sigma(adjusted) ** 2

    limit = float(stdtrit(max(len(d) - 1, 1), 0.5 + CONFIDENCE / 2.0))

    def without(chosen: np.ndarray, label: str, group: str = "", t: float = np.nan) -> LeftOut:
        scale = np.sqrt(np.diagonal(q)[chosen])
        solved = np.linalg.solve(q[np.ix_(chosen, chosen)] / np.outer(scale, scale), value[chosen] / scale) / scale
        difference = d - q_points[:, :, chosen] @ solved
        worse, share = _worse(d, difference, variance), _share(d, difference, variance)
        return LeftOut(label, group, difference, t, worse, limit, share)

    families = np.array([Parameter.of(name).family for name in p.names[rows]])
    found = [without(np.arange(len(rows)), "all")]
    if len(set(families)) > 1:
        found += [without(np.flatnonzero(families == family), family) for family in dict.fromkeys(families)]
    found += [
        without(np.array([k]), str(p.names[row]), str(p.groups[row]), float(p.t[row]))
        for k, row in enumerate(rows)
        if np.sum(families == families[k]) <= INDIVIDUALLY * len(set(p.groups[rows].tolist()))
    ]
    return ParameterEffects(d, tuple(found))


def _cofactors(system: NormalSystem, solution: Solution, factor: Factor, columns: np.ndarray, at: np.ndarray):
    """Cofactors of points with shared parameters (k, 3, a), and of these among themselves (a, a)."""
    count = len(columns)
    q_points, q = np.empty((len(at), 3, count)), np.empty((count, count))
    for start in range(0, count, AT_ONCE):
        own = slice(start, start + AT_ONCE)
        sides = np.zeros((len(system.unknowns.shared), len(columns[own])))
        sides[columns[own], np.arange(sides.shape[1])] = 1.0
        nothing = np.zeros((len(system.unknowns.points), 3, sides.shape[1]))
        _, shared, points = solve_sides(system, solution.state, factor, nothing, solution.estimator, sides)
        q_points[:, :, own], q[:, own] = points[at], shared[columns]
    return q_points, q


def _given_sigma(adjusted: AdjustedBlock) -> np.ndarray:
    row_of = {int(point): row for row, point in enumerate(adjusted.block.control.point)}
    return adjusted.block.control.sigma[[row_of[int(point)] for point in adjusted.check.point]]


def _worse(before: np.ndarray, after: np.ndarray, variance: np.ndarray) -> float:
    growth = np.nansum((after**2 - before**2) / variance, axis=1)
    spread = growth.std(ddof=1) if len(growth) > 1 else 0.0
    if len(growth) < FEWEST_POINTS or spread == 0.0:
        return float("nan")
    return float(growth.mean() / (spread / np.sqrt(len(growth))))


def _share(before: np.ndarray, after: np.ndarray, variance: np.ndarray) -> float:
    return float(np.nansum(after**2 / variance) / np.nansum(before**2 / variance)) - 1.0
