"""What an adjustment of ours states, with the noise alone and in total."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import aerotri
from league_programs.stated import INTERIOR, Held, Stated, bare

DEGREES = np.array([1.0, 1.0, 1.0, *[np.degrees(1.0)] * 3])
ELEMENT_OF = {"focal_length_mm": "c", "x0_mm": "x0", "y0_mm": "y0"}


def stated(program: str, found: aerotri.Adjustment, total: bool) -> Stated:
    """σ of an adjustment.

    Parameters
    ----------
    total : with the model part; else of the noise.
    """
    adjusted = found.adjusted
    which = "total_sigma" if total else "sigma"
    block = adjusted.block
    images = getattr(adjusted.images, which) * DEGREES
    return Stated(
        program,
        photographs=_named(np.array([bare(str(name)) for name in block.images.names]), images),
        points=_named(block.points, getattr(adjusted.points, which)),
        interior=_interior(adjusted.parameters, getattr(adjusted.parameters, which)),
        held=held(found, which),
    )


def adjusted(block: aerotri.Block, parameters: str, robust: str) -> aerotri.Adjustment | str:
    try:
        found = aerotri.adjust(block, parameters=parameters, robust=robust, max_iterations=150, explain=False)  # pyright: ignore[reportArgumentType]
    except (aerotri.AdjustmentFailedError, aerotri.InputError) as failure:
        return str(failure)
    return found if found.status == "converged" else found.adjusted.outcome.message


def _named(names: np.ndarray, sigma: np.ndarray) -> dict[str, np.ndarray]:
    return {str(name): row for name, row in zip(names, sigma, strict=True) if np.isfinite(row).all()}


def _interior(parameters, sigma: np.ndarray) -> dict[str, np.ndarray]:
    out: dict[str, np.ndarray] = {}
    for k in np.flatnonzero(np.isin(parameters.names, list(ELEMENT_OF))):
        own = out.setdefault(str(parameters.groups[k]), np.full(3, np.nan))
        own[INTERIOR.index(ELEMENT_OF[str(parameters.names[k])])] = sigma[k]
    return out


def held(found: aerotri.Adjustment, which: str) -> Held | None:
    """Check points with their σ."""
    check, control = found.adjusted.check, found.block.control
    row = {int(point): k for k, point in enumerate(control.point)}
    seen = np.flatnonzero(np.isfinite(check.difference).all(axis=1))
    if not len(seen):
        return None
    given = np.array([control.sigma[row[int(point)]] for point in check.point[seen]])
    return Held(check.difference[seen], getattr(check, which)[seen], given)


def without_each(found: aerotri.Adjustment) -> list[aerotri.Adjustment]:
    """The adjustment without each of its control points in turn, which is a check point then."""
    block = found.block
    images = replace(block.images, centre=found.adjusted.images.centre, angles=found.adjusted.images.angles)
    start, out = replace(block, images=images), []
    for name in block.points[block.control.point[~block.control.is_check]].astype(str):
        try:
            one = aerotri.adjust(aerotri.edit(start, check=[name]), explain=False)
        except aerotri.AdjustmentFailedError:
            continue
        if one.status == "converged" and len(one.adjusted.check):
            out.append(one)
    return out


def together(parts: list[Held | None]) -> Held | None:
    """Points of several adjustments as one list."""
    there = [part for part in parts if part is not None]
    columns = [[getattr(part, name) for part in there] for name in ("difference", "sigma", "given")]
    return Held(*(np.concatenate(column) for column in columns)) if there else None
