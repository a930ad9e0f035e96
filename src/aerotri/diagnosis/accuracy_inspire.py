"""The accuracy in the measures of INSPIRE, and which data it is good enough for.

[L: INSPIRE data specification on Orthoimagery, technical guidelines D2.8.II.3, 7.1.2 (RMSEP, RMSE-x and RMSE-y
jointly); on Elevation, D2.8.II.1, 7.1.7, 7.1.8 and table 11 (recommended results).] Neither has minimum requirements.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.results.accuracy import AccuracyRecord

OF_GRID = (6.0, 3.0)
"""Grid spacing over RMSE_P and over RMSE of heights, at least [L: table 11]."""
OF_INTERVAL, OF_SCALE = 6.0, 10_000.0
"""Contour interval over RMSE of heights, scale denominator over RMSE_P in metres, at least [L: table 11]."""


@dataclass(frozen=True)
class InspireAccuracy:
    """Measures of ISO 19157 with their numbers, and what table 11 allows; NaN where there are no check points.

    Parameters
    ----------
    rmse_p : m, measure 47. rmse_x, rmse_y : m, adapted from 39. rmse_z : m, measure 39.
    spacing : m, of the finest elevation grid. interval : m, the smallest one of contour lines.
    scale : denominator of the largest scale.
    """

    rmse_p: float
    rmse_x: float
    rmse_y: float
    rmse_z: float
    spacing: float
    interval: float
    scale: float


def inspire_accuracy(r: AccuracyRecord) -> InspireAccuracy:
    """The measures, with the survey error of the check points as in all numbers of the page."""
    plan, height = r.rmse_h, r.nva
    spacing = float(np.maximum(OF_GRID[0] * plan, OF_GRID[1] * height))
    return InspireAccuracy(
        plan, r.errors[0].rmse, r.errors[1].rmse, height, spacing, OF_INTERVAL * height, OF_SCALE * plan
    )
