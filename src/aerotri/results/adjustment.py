"""An adjustment whole: its result, and the equations and the solution that it came from."""

from __future__ import annotations

from dataclasses import dataclass

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.coordinates import LocalFrame
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.model_part import ModelRoot, SetDifference
from aerotri.results.parameter_comparison import ParameterComparison


@dataclass(frozen=True, eq=False)
class Adjustment:
    """A result together with what it came from, for stages that need covariances beyond σ.

    Parameters
    ----------
    result : in the block's CRS. local : the same in the local frame, where `system` and `solution` live.
    frame : the local frame, None for a block in local coordinates.
    model : what the model part of σ is made of, for σ of whatever follows from the unknowns; None where there is none.
    compared : the sets of additional parameters that were compared where the choice was left to the program.
    other : how another set differs that the choice could not tell from the one it took; None where there is none.
    """

    result: AdjustedBlock
    local: AdjustedBlock
    system: NormalSystem
    solution: Solution
    frame: LocalFrame | None = None
    compared: ParameterComparison | None = None
    model: ModelRoot | None = None
    other: SetDifference | None = None
