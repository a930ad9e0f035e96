"""The normal system of the rays that take part, with its datum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.datum import ExtraObservations, free_motions, minimal_coordinates
from aerotri.adjustment.extra_observations import extra_observations
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.ray_status import RayStatus
from aerotri.adjustment.unknowns import (
    StartValues,
    State,
    Unknowns,
    build_unknowns,
    hold_orientation,
    hold_points,
)
from aerotri.conventions import InputError
from aerotri.observations import Block


def build_system(
    block: Block, start: StartValues, status: np.ndarray, held: list[tuple[int, int]] | None = None,
    last: np.ndarray | None = None,
) -> tuple[NormalSystem, State]:  # fmt: skip
    """The normal system of the rays that take part, and its start state.

    Parameters
    ----------
    status : (m,) of the rays. held : (row of the block's points, axis) of coordinates held for a minimal or inner
        datum; chosen anew where None.
    last : photographs of the block that are eliminated last, see `sparse_cholesky.Symbolic`.

    Raises
    ------
    InputError
        Where no ray takes part.
    """
    if not (status == RayStatus.USED).any():
        raise nothing_to_adjust()
    unknowns, state = build_unknowns(block, start, status == RayStatus.USED)
    unknowns, extras = extra_observations(unknowns, state)
    state = replace(state, shared=np.array(unknowns.shared.start, dtype=float))
    unknowns = _with_datum(unknowns, state, extras, held)
    rows = None if last is None else np.flatnonzero(np.isin(unknowns.images, last))
    return NormalSystem(unknowns, extras, state.centre[:, :2], rows), state


def nothing_to_adjust(why: str = "") -> InputError:
    """The error of a block without a ray that takes part."""
    return InputError(
        "no image point can be adjusted" + (f": {why}" if why else ""),
        "a point has to be measured in two photographs that have orientations, and its rays have to meet",
        file="image_points.csv",
    )


def _with_datum(
    unknowns: Unknowns, state: State, extras: list[ExtraObservations], held: list[tuple[int, int]] | None
) -> Unknowns:
    settings = unknowns.block.settings.adjustment
    if settings.datum == "fixed":
        return hold_orientation(unknowns, settings.datum_fixed)
    if settings.is_free:
        unknowns = replace(unknowns, motions=free_motions(unknowns, extras, state))
        if held is None:
            return hold_points(unknowns, minimal_coordinates(unknowns, state))
        row = {int(point): k for k, point in enumerate(unknowns.points)}
        return hold_points(unknowns, [(row[point], axis) for point, axis in held])
    return unknowns
