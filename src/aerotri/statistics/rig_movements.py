"""Deviations of photographs from their places on a weighted rig, and how they fit the σ of the movements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.kernel_records import Inverse
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.rig_ties import TieRows, Ties
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.unknowns import State
from aerotri.observations.rigs import STATION
from aerotri.results.adjusted_block import ObservationGroup
from aerotri.results.rigs import RigMovements


@dataclass(frozen=True, eq=False)
class MovementFit:
    """How the deviations of k cameras in position and rotation fit their σ.

    Parameters
    ----------
    count, omega, redundancy, information : (k, 2) observations, vᵀPv, Σ redundancy numbers, and Σ R_ij² over the
        elements of the same photograph: what θ = σ²/σ²used is known by.
    """

    count: np.ndarray
    omega: np.ndarray
    redundancy: np.ndarray
    information: np.ndarray


def movement_fit(ties: Ties, rows: TieRows, inverse: Inverse) -> MovementFit:
    """From whitened rows and the inverse of the normal matrix on its pattern."""
    shape = ties.sigma.shape
    count, omega, redundancy, information = (np.zeros(shape) for _ in range(4))
    r = np.eye(6) - ties.cofactors(rows, inverse)
    for what, own in enumerate((slice(0, 3), slice(3, 6))):
        np.add.at(count[:, what], ties.mounting, 3.0)
        np.add.at(omega[:, what], ties.mounting, np.sum(rows.deviation[:, own] ** 2, axis=1))
        np.add.at(redundancy[:, what], ties.mounting, np.trace(r[:, own, own], axis1=1, axis2=2))
        np.add.at(information[:, what], ties.mounting, np.sum(r[:, own, own] ** 2, axis=(1, 2)))
    return MovementFit(count, omega, redundancy, information)


def movement_groups(system: NormalSystem, state: State, inverse: Inverse) -> list[ObservationGroup]:
    """The groups of observations that movements are."""
    ties, rows = system.unknowns.ties, system.tie_rows(state)
    if ties is None or rows is None:
        return []
    fit = movement_fit(ties, rows, inverse)
    out = []
    for k, camera in enumerate(ties.mountings.cameras):
        for what, word in enumerate(("positions", "rotations")):
            # what does not move is no group of its own
            if fit.count[k, what] and ties.sigma[k, what] > 0.0:
                sigma = 1.0 / float(ties.inv_sigma[ties.mounting == k][0, 3 * what])
                own = fit.omega[k, what] / fit.count[k, what], fit.omega[k, what] / max(fit.redundancy[k, what], 1e-300)
                rms, after = (sigma * float(np.sqrt(value)) for value in own)
                out.append(
                    ObservationGroup(
                        f"{word} on the rig, {camera}", int(fit.count[k, what]), sigma, rms,
                        float(fit.redundancy[k, what]), after if fit.redundancy[k, what] > 1e-9 else float("nan"),
                    )
                )  # fmt: skip
    return out


def rig_movements(system: NormalSystem, solution: Solution, inverse: Inverse, sigma0: float) -> RigMovements | None:
    """The deviations of all photographs on weighted rigs; None where there are none."""
    u, ties = system.unknowns, system.unknowns.ties
    if ties is None:
        return None
    state = solution.state
    rows = ties.rows(state.centre, state.rotation, state.shared, u.turn(state), u.eo_free)
    whitened = ties.whitened(rows)
    fit = movement_fit(ties, whitened, inverse)
    sigma = sigma0 * np.sqrt(np.maximum(np.diagonal(ties.cofactors(rows, inverse), axis1=1, axis2=2), 0.0))
    rigs = {camera: rig for rig in u.block.rigs for camera in rig.cameras}
    cameras = ties.mountings.cameras
    own = sorted(set(ties.mounting.tolist()))
    with np.errstate(divide="ignore"):
        relative = np.sqrt(1.0 / (2.0 * fit.information))
    image = u.images[ties.image]
    return RigMovements(
        rig=np.array([rigs[cameras[k]].name for k in own], dtype=object),
        camera=np.array([cameras[k] for k in own], dtype=object),
        sigma=sigma0 * ties.sigma[own],
        sigma_sigma=np.where(ties.sigma[own] > 0.0, sigma0 * ties.sigma[own] * relative[own], np.nan),
        image=image,
        station=np.asarray(u.block.images.columns[STATION], dtype=object)[image],
        of=np.array([own.index(k) for k in ties.mounting.tolist()], dtype=np.int64),
        deviation=rows.deviation,
        deviation_sigma=sigma,
    )
