"""The joint covariance of chosen unknowns, with their names."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from aerotri.results.adjustment import Adjustment
    from aerotri.statistics.joint_covariance import Chosen

MOST_SHOWN = 12
"""Unknowns whose correlations a notebook shows; chosen [C]: as many columns as fit a page."""


@dataclass(frozen=True, eq=False, repr=False)
class Covariance:
    """Covariance matrix of k unknowns, σ̂0² included.

    Parameters
    ----------
    names : (k,) such as 'T000457:X', '1_008:omega', 'bluh.1'.
    matrix : (k, k); coordinates in m, angles in rad, parameters in their own unit. Of the noise.
    model : (k, k), the model part: errors that groups of photographs share; None where there is none.

    Examples
    --------
    >>> import numpy as np
    >>> found = Covariance(("T1:X", "T1:Y"), np.array([[4e-4, 1e-4], [1e-4, 1e-4]]))
    >>> found.sigma.round(3).tolist()
    [0.02, 0.01]
    >>> found.correlation.round(2).tolist()
    [[1.0, 0.5], [0.5, 1.0]]
    """

    names: tuple[str, ...]
    matrix: np.ndarray
    model: np.ndarray | None = None

    @property
    def sigma(self) -> np.ndarray:
        """(k,) standard deviations, of the noise."""
        return np.sqrt(np.diagonal(self.matrix))

    @property
    def total(self) -> np.ndarray:
        """(k, k) with the model part."""
        return self.matrix if self.model is None else self.matrix + self.model

    @property
    def total_sigma(self) -> np.ndarray:
        """(k,) standard deviations with the model part: tX, tY, tZ of the tables."""
        return np.sqrt(np.diagonal(self.total))

    @property
    def correlation(self) -> np.ndarray:
        """(k, k) correlation coefficients; NaN with an unknown that is held."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.matrix / np.outer(self.sigma, self.sigma)

    def __repr__(self) -> str:
        return f"<aerotri.Covariance of {', '.join(self.names)}>"

    def _repr_html_(self) -> str:
        """σ and correlations, as a notebook shows them."""
        names, sigma, r = self.names[:MOST_SHOWN], self.sigma, self.correlation
        total = None if self.model is None else self.total_sigma
        head = "" if total is None else "<th>total σ</th>"
        head += "".join(f"<th>{escape(name)}</th>" for name in names)
        rows = "".join(
            f"<tr><th>{escape(name)}</th><td>{sigma[i]:.4g}</td>"
            + ("" if total is None else f"<td>{total[i]:.4g}</td>")
            + "".join(f"<td>{r[i, j]:+.3f}</td>" for j in range(len(names)))
            + "</tr>"
            for i, name in enumerate(names)
        )
        return f"<table><thead><tr><th></th><th>σ</th>{head}</tr></thead><tbody>{rows}</tbody></table>"


def covariance_of(adjustment: Adjustment, names: list[str]) -> Covariance:
    """The joint covariance of unknowns, in the coordinate system of the block.

    Parameters
    ----------
    adjustment : with its equations. names : as `statistics.joint_covariance.choose_unknowns` understands them.

    Raises
    ------
    InputError
        For a name that means nothing.
    """
    from aerotri.statistics.joint_covariance import choose_unknowns, joint_cofactors

    system, solution = adjustment.system, adjustment.solution
    chosen = choose_unknowns(system.unknowns, names)
    factor = system.factorise(solution.equations)
    q, model = joint_cofactors(system, solution.state, factor, solution.estimator, chosen, adjustment.model)
    turn = _into_crs(adjustment, chosen)
    whole = adjustment.result.outcome.sigma0**2 * turn @ q @ turn.T
    wanted = np.ix_(_wanted(chosen), _wanted(chosen))
    labels = tuple(label for one in chosen for label in one.labels)
    if model is None:
        return Covariance(labels, whole[wanted])
    return Covariance(labels, whole[wanted], _as_in_tables(adjustment, chosen, turn @ model @ turn.T)[wanted])


def _as_in_tables(adjustment: Adjustment, chosen: list[Chosen], model: np.ndarray) -> np.ndarray:
    """The joint model part with the variances of the tables, which are found point by point.

    Without negative eigenvalues a joint matrix has larger variances than each of its parts has alone.
    """
    known = np.concatenate([_of_table(adjustment, one) for one in chosen])
    own = np.diagonal(model)
    scale = np.sqrt(np.divide(known, own, out=np.ones_like(own), where=own > 0.0))
    return model * np.outer(scale, scale) + np.diag(np.where(own > 0.0, 0.0, known))


def _of_table(adjustment: Adjustment, one: Chosen) -> np.ndarray:
    """The variances of the model part of one point, photograph or parameter in the tables."""
    from aerotri.statistics.joint_covariance import IMAGE, POINT

    points, images = adjustment.result.points.model, adjustment.result.images.model
    if one.kind == POINT and points is not None:
        return np.diagonal(points[one.of_block])
    if one.kind == IMAGE and images is not None:
        return np.diagonal(images[one.of_block])
    p, shared = adjustment.result.parameters, adjustment.system.unknowns.shared
    row = np.flatnonzero((p.names == shared.names[one.row]) & (p.groups == shared.groups[one.row]))
    return np.zeros(1) if p.model is None else p.model[row[:1], row[:1]]


def _into_crs(adjustment: Adjustment, chosen: list[Chosen]) -> np.ndarray:
    """Partials of coordinates and angles in the CRS by those in the local frame."""
    from aerotri.results.in_crs import orientation_partials
    from aerotri.statistics.joint_covariance import IMAGE, POINT

    frame, local = adjustment.frame, adjustment.local
    sizes = [{POINT: 3, IMAGE: 6}.get(one.kind, 1) for one in chosen]
    turn, first = np.eye(sum(sizes)), 0
    for one, size in zip(chosen, sizes, strict=True):
        if frame is not None and size > 1:
            row, own = one.of_block, slice(first, first + size)
            if size == 3:
                turn[own, own] = frame.crs_per_local(local.points.xyz[row : row + 1])[0]
            else:
                centre, angles = local.images.centre[row : row + 1], local.images.angles[row : row + 1]
                turn[own, own] = orientation_partials(centre, angles, frame, local.block.rotation)[0]
        first += size
    return turn


def _wanted(chosen: list[Chosen]) -> list[int]:
    """Rows of the scalars that were asked for."""
    from aerotri.statistics.joint_covariance import IMAGE, POINT

    rows, first = [], 0
    for one in chosen:
        rows += [first + part for part in one.parts]
        first += {POINT: 3, IMAGE: 6}.get(one.kind, 1)
    return rows
