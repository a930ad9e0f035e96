"""σ of the movements of cameras on weighted rigs, estimated from the block by restricted maximum likelihood.

At the maximum the sum of squares of the deviations of a camera is σ̂0² times their redundancy [L: Helmert 1907;
Förstner 1979]. A round changes σ² by θ − 1 = (Ω/σ̂0² − r)/Σ R_ij², Newton's step with what photographs of other stations
contribute left out, and adjusts again.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.rig_ties import LEAST, Ties
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import NotPositiveDefiniteError
from aerotri.observations import Block
from aerotri.statistics.rig_movements import movement_fit
from aerotri.statistics.summarise import count_observations, effective_redundancy, weighted_sum

MOST_ROUNDS = 15
SETTLED = 0.02
"""Relative change of every σ below which they stand [C]."""
LARGEST_STEP = 3.0
"""Factor by which a σ may change in one round."""
NOTHING = 0.05
"""Share of redundancy in the deviations of a camera below which movements that still shrink are 0 [C]: what image
points say of them would then be taken for noise anyway."""
CAUTION = 2.0
"""Added to Σ R_ij² below `FEWEST`, but no more than the redundancy, as for the σ of whole groups."""
FEWEST = 3.0


def to_be_estimated(system: NormalSystem) -> np.ndarray:
    """(k, 2) bool, which σ of movements the block does not state."""
    ties = system.unknowns.ties
    if ties is None:
        return np.zeros((0, 2), dtype=bool)
    there = np.bincount(ties.mounting, minlength=len(ties.sigma)) > 0
    mounted = {camera: mounting for rig in system.unknowns.block.rigs for camera, mounting in rig.cameras.items()}
    cameras = [mounted[name] for name in ties.mountings.cameras]
    return np.array([[c.movement_m is None, c.movement_rad is None] for c in cameras]) & there[:, None]


def with_estimated_movements(
    system: NormalSystem, solution: Solution, options: SolveOptions
) -> tuple[NormalSystem, Solution, np.ndarray]:
    """The adjustment with the σ of movements estimated, as far as the block does not state them.

    Returns
    -------
    System, solution, and (k, 2) bool: which were estimated.
    """
    wanted, ties = to_be_estimated(system), system.unknowns.ties
    if ties is None or not wanted.any() or solution.status != "converged":
        return system, solution, np.zeros_like(wanted)
    unit = _noticed(system, solution, ties)
    sigma, awake = np.where(wanted, unit, ties.sigma), wanted.copy()
    for _ in range(MOST_ROUNDS):
        system = system.with_movements(sigma, _with_movements(system.unknowns.block, ties, sigma, wanted))
        system, again = minimise_at_adjusted(system, solution.state, count_observations(system).redundancy, options)
        solution = replace(again, iterations=solution.iterations + again.iterations)
        found = _change(system, solution) if solution.status == "converged" else None
        if found is None:
            break
        change, share = found
        sigma = np.where(awake, sigma * change, sigma)
        gone = awake & (share < NOTHING) & (change < 1.0)
        if gone.any():
            sigma, awake = np.where(gone, 0.0, sigma), awake & ~gone
        elif (np.abs(change - 1.0)[awake] < SETTLED).all():
            break
    return system, solution, wanted


def _noticed(system: NormalSystem, solution: Solution, ties: Ties) -> np.ndarray:
    """(k, 2) m and rad, movements that displace image points by their σ."""
    u, state = system.unknowns, solution.state
    out = np.zeros_like(ties.sigma)
    for k in range(len(out)):
        rows = ties.image[ties.mounting == k]
        if not len(rows):
            continue
        focal = u.block.cameras[int(u.block.images.camera[u.images[rows[0]]])].focal_length_mm
        own = np.isin(u.rays.image, rows)
        points = np.repeat(np.arange(len(u.points)), np.diff(u.rays.start))[own]
        far = np.linalg.norm(state.points[points] - state.centre[u.rays.image[own]], axis=1)
        angle = u.block.settings.image_sigma_um * 1e-3 / focal
        out[k] = angle * float(np.median(far)) if len(far) else 1.0, angle
    return np.maximum(out, LEAST)


def _change(system: NormalSystem, solution: Solution) -> tuple[np.ndarray, np.ndarray] | None:
    """(k, 2) factors of the σ, and the share of redundancy in the deviations; None where the equations are singular."""
    ties, rows = system.unknowns.ties, system.tie_rows(solution.state)
    if ties is None or rows is None:
        return None
    try:
        inverse = system.factorise(solution.equations).inverse_on_pattern()
    except NotPositiveDefiniteError:
        # what is not determined is named where the result is factorised
        return None
    fit = movement_fit(ties, rows, inverse)
    variance = weighted_sum(system, solution) / max(effective_redundancy(system, solution), 1.0)
    caution = np.where(fit.information < FEWEST, np.minimum(fit.redundancy, CAUTION), 0.0)
    theta = 1.0 + (fit.omega / variance - fit.redundancy) / np.maximum(fit.information + caution, 1e-12)
    share = fit.redundancy / np.maximum(fit.count, 1.0)
    return np.sqrt(np.clip(theta, LARGEST_STEP**-2, LARGEST_STEP**2)), share


def _with_movements(block: Block, ties: Ties, sigma: np.ndarray, wanted: np.ndarray) -> Block:
    """The block that states the σ that were estimated."""
    found = {}
    for k, camera in enumerate(ties.mountings.cameras):
        found[camera] = {
            name: float(sigma[k, what]) for what, name in enumerate(("movement_m", "movement_rad")) if wanted[k, what]
        }
    rigs = tuple(
        replace(rig, cameras={name: replace(one, **found.get(name, {})) for name, one in rig.cameras.items()})
        for rig in block.rigs
    )
    return replace(block, rigs=rigs)
