"""Both checks of an adjusted block."""

from __future__ import annotations

from collections.abc import Callable

from aerotri.conventions import InputError
from aerotri.crosscheck.comparison import CrosscheckResult, PeerCheck
from aerotri.crosscheck.paper_block import all_parameters, parameters_text
from aerotri.crosscheck.paper_check import check_with_paper
from aerotri.crosscheck.paper_families import unknown_parameters
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock


def crosscheck(
    adjusted: AdjustedBlock,
    adjust: Callable[[Block], AdjustedBlock],
    report: Callable[[str], None] | None = None,
) -> CrosscheckResult:
    """The block through pycolmap and through an independent model, differences against our σ.

    Parameters
    ----------
    adjusted : a converged adjustment.
    adjust : adjusts a block; needed again for blocks freed of systematic errors or with fixed weights.
    report : called with what is being done.

    Raises
    ------
    InputError
        For a block with rigid rigs or a rolling shutter, which the peers do not know.
    """
    if adjusted.rigs:
        raise InputError(
            "the cross-check knows no rigid rigs",
            f'cross-check an adjustment with rig.{adjusted.rigs[0].rig}.constraint = "off"',
        )
    if adjusted.rolling_shutters is not None:
        camera = adjusted.rolling_shutters.readouts[0].camera
        raise InputError(
            "the cross-check knows no rolling shutter",
            f"cross-check an adjustment without [camera.{camera}.rolling_shutter]",
        )
    tell: Callable[[str], None] = report or (lambda text: None)
    tell("adjusting through pycolmap")
    colmap = _colmap(adjusted, adjust)
    tell("adjusting by the independent model")
    paper = check_with_paper(adjusted, adjust)
    unknown = parameters_text(unknown_parameters(all_parameters(adjusted.block)))
    return CrosscheckResult(adjusted.block.name, (colmap, paper), _parameters(adjusted), tuple(unknown))


def _parameters(adjusted: AdjustedBlock) -> tuple[str, ...]:
    """What the block has for parameters, estimated or held at a value: linear families and others in words."""
    families = {family: () for family, _ in all_parameters(adjusted.block)}
    families |= {family: () for camera in adjusted.block.cameras for family in ("brown", "lens")
                 if any(prior.value for prior in getattr(camera, family).values())}  # fmt: skip
    names = (str(name) for name in adjusted.parameters.names)
    return tuple(dict.fromkeys([*families, *(name.partition(".")[0] for name in names)]))


def _colmap(adjusted: AdjustedBlock, adjust: Callable[[Block], AdjustedBlock]) -> PeerCheck:
    try:
        from aerotri.crosscheck.colmap_check import check_with_colmap
    except ImportError as missing:
        return PeerCheck(
            "pycolmap", "points and orientation through pycolmap", "not available",
            f"{missing.name} is not installed (pip install 'aerotri[ceres]')",
        )  # fmt: skip
    return check_with_colmap(adjusted, adjust)
