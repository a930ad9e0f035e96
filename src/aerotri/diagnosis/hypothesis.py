"""A usual mistake, what undoes it, and how it is said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from aerotri.diagnosis.changes import Change
from aerotri.diagnosis.free_model import FreeModel


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A mistake that may explain a block.

    Parameters
    ----------
    subject : what is wrong: 'photograph 7: its measurements', 'GNSS positions'.
    remedy : with what it fits: 'x negated', 'X and Y exchanged'.
    change : the block as it should be.
    on_model : what the change does to the model of the image points; None where it does nothing.
    plural : whether the subject 'fit' or 'fits'.
    note : a sentence behind it, such as what would look the same.
    free_focal : whether the principal distance is estimated along with it, and said.
    """

    subject: str
    remedy: str
    change: Change
    on_model: Callable[[FreeModel], FreeModel] | None = None
    plural: bool = True
    note: str = ""
    free_focal: bool = False
