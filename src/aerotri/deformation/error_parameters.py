"""The parameters of an adjustment that move image points: additional parameters and those of rolling shutters."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment import scanning
from aerotri.results.adjustment import Adjustment

KINDS = ("additional", scanning.KIND)
"""Of shared parameters whose effect is an image error."""


def error_rows(calibration: Adjustment) -> np.ndarray:
    """(p,) rows of the parameters that were adjusted, in the record of the shared parameters."""
    p = calibration.local.parameters
    return np.flatnonzero(np.isin(p.kinds, KINDS) & np.isin(p.status, ("estimated", "weighted")))


def shared_columns(calibration: Adjustment) -> np.ndarray:
    """(p,) the shared unknowns of the system that `error_rows` are."""
    shared, p = calibration.system.unknowns.shared, calibration.local.parameters
    place = {key: column for column, key in enumerate(zip(shared.names, shared.groups, strict=True))}
    rows = error_rows(calibration)
    return np.array([place[str(p.names[row]), str(p.groups[row])] for row in rows], dtype=np.int64)
