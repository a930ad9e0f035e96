"""A result folder opened again: solution.npz and the block beside it, held against each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.adjustment.ray_status import RayStatus
from aerotri.conventions import FilePath, InputError
from aerotri.formats.block.folder import read_block
from aerotri.formats.results.solution import SavedSolution, read_solution
from aerotri.observations import Block
from aerotri.pipeline import AdjustmentFailedError, reopen
from aerotri.results.adjustment import Adjustment

REMEDY = "give the folder that `aerotri adjust` wrote, or adjust the block again"
SAME_SIGMA0 = 1e-5
"""Relative difference of σ0 when a result is linearised again: far above rounding, far below any change of a file."""


def open_result(folder: FilePath) -> Adjustment:
    """The adjustment of a result folder, linearised and factorised once.

    Raises
    ------
    InputError
        When solution.npz or the block is damaged, or they do not belong together.
    """
    path = Path(folder) / "solution.npz"
    if not path.is_file():
        raise InputError("holds no adjustment: solution.npz is missing", REMEDY, folder)
    block = read_block(Path(folder) / "block")
    saved = read_solution(path, block)
    _check_rays(block, saved, path)
    try:
        found = reopen(block, saved)
    except AdjustmentFailedError as failure:
        raise InputError(f"does not belong to the block beside it: {failure}", REMEDY, path) from None
    except InputError as error:
        raise InputError(error.message, error.remedy or REMEDY, error.file or path, error.line) from error
    sigma0 = found.result.outcome.sigma0
    if not np.isclose(sigma0, saved.sigma0, rtol=SAME_SIGMA0, atol=0.0, equal_nan=True):
        if saved.status != "converged":
            raise InputError(f"the adjustment ended '{saved.status}'", "give the result of a converged one", folder)
        differs = f"σ0 {saved.sigma0:.6g} in the file, {sigma0:.6g} with the block"
        raise InputError(f"does not belong to the block beside it: {differs}", REMEDY, path)
    return found


def _check_rays(block: Block, saved: SavedSolution, path: Path) -> None:
    """Every ray that was used has a photograph and a point that were adjusted; what is held was measured."""
    rays = block.image_points
    used = saved.ray_status == RayStatus.USED
    for good, what in (
        (bool(used.any()), "no ray is used"),
        (bool(np.isfinite(saved.centre[rays.image[used]]).all()), "a ray is used, its photograph is not adjusted"),
        (bool(np.isfinite(saved.points[rays.point[used]]).all()), "a ray is used, its point is not adjusted"),
        (bool(np.isin(saved.held[:, 0], rays.point[used]).all()), "a point is held that no ray measures"),
    ):
        if not good:
            raise InputError(f"does not belong to the block beside it: {what}", REMEDY, path)
