"""deform.json and demcor.json: what the programs print and write, as plain values without NaN.

deform.json of one model::

    { "aerotri": "0.1.0", "block": "saar", "kind": "pair",           // pair | normal case
      "title": "", "variant": "free",                                // free | absorbed
      "pair": ["01_003", "01_004"], "group": "ucd8", "crs": "local", "ground": "flat at 60.0 m",
      "end_lap": 0.663, "base_mm": 22.75, "base_m": 0, "height_m": 0, "h_over_b": 4.46, "gsd_m": 0.09,
      "cm_per_um": 0,                                                // dZ for 1 µm of x-parallax
      "spacing_m": 0, "nodes": 0,
      "dX": {"min": 0, "max": 0, "mean": 0, "rms": 0}, "dY": {}, "dZ": {},          // m, wrong − true
      "sigma_dX": {"min": 0, "max": 0, "mean": 0, "rms": 0}, "sigma_dY": {}, "sigma_dZ": {}, "sigma_includes": "",
      "y_parallax_um": {"max": 0, "rms": 0}, "contour_interval_m": 0.05 }

of a block: "kind": "block", no pair, group, base, end lap and parallax, but::

      "models": [{"number": 0, "left": "", "right": "", "h_over_b": 0, "end_lap": 0, "cm_per_um": 0, "nodes": 0}],
      "seams": {"count": 0, "nodes": 0, "rms": 0, "worst": [{"first": ["", ""], "second": ["", ""], "nodes": 0,
                "mean": 0, "rms": 0, "max": 0}]}                     // m, dZ of the first less dZ of the second

demcor.json::

    { "aerotri": "0.1.0", "block": "saar", "dem": "", "variant": "free",            // free | absorbed | given
      "models": [["01_003", "01_004"]], "cells": 0, "corrected": 0, "no_data": 0, "outside_models": 0,
      "before": {"min": 0, "max": 0, "mean": 0}, "after": {}, "dZ": {"min": 0, "max": 0, "mean": 0, "rms": 0},
      "sigma_dZ": {"min": 0, "max": 0, "mean": 0, "rms": 0, "cell_m": 0}, "sigma_includes": "",
      "seams": {"count": 0, "places": 0, "rms_before": 0, "rms_after": 0,
                "worst": [{"first": ["", ""], "second": ["", ""], "places": 0, "mean_before": 0, "rms_before": 0,
                           "mean_after": 0, "rms_after": 0}]},
      "accuracy_m": {"fit": 0.0002, "tables": 0}, "halo_cells": 0, "timings_s": {"read": 0, "write": 0, "total": 0} }
"""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri import of_known
from aerotri.deformation.block_models import BlockDeformation, BlockModel, Seam
from aerotri.deformation.dem_correction import DemOutcome
from aerotri.deformation.dem_window import FIT_TOLERANCE_M, DemModels
from aerotri.deformation.model_grid import Deformation
from aerotri.deformation.restitution import sigma_in_words
from aerotri.formats.results.json_text import number_or_none
from aerotri.rasters.grids import Grid
from aerotri.version import __version__

WORST_SEAMS = 10
"""Seams that are listed by name; chosen [C]: counts and RMS beside them are those of all seams."""
FEWEST_ON_SEAM = 4
"""Nodes or places of a seam that is named among the worst: a corner where models touch is none."""
CONTOUR_INTERVALS_M = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
"""Intervals of contour lines, m: 1, 2 and 5 times powers of ten, as maps have them."""
MOST_CONTOURS = 25
"""Lines over the range of heights at most; chosen [C]: the paper's maps, 5 or 10 cm over decimetres, have fewer; more
run into one another."""


def contour_interval(low: float, high: float) -> float:
    """m between contour lines of a range of heights: 5 or 10 cm where it is of decimetres, as in the paper."""
    for interval in CONTOUR_INTERVALS_M:
        if (high - low) / interval <= MOST_CONTOURS:
            return interval
    return CONTOUR_INTERVALS_M[-1]


def deformation_json(deformation: Deformation, block: str) -> dict[str, Any]:
    """deform.json of one model."""
    d, g = deformation, deformation.geometry
    low, high = of_known.smallest(d.d[..., 2]), of_known.largest(d.d[..., 2])
    parallax = 1e3 * d.parallax
    return {
        "aerotri": __version__,
        "block": block,
        "kind": "normal case" if d.names is None else "pair",
        "title": d.title,
        "variant": d.variant,
        "pair": None if d.names is None else list(d.names),
        "group": d.group,
        "crs": d.crs,
        "ground": d.ground,
        "end_lap": g.end_lap,
        "base_mm": g.base_mm,
        "base_m": g.base_m,
        "height_m": g.height_m,
        "h_over_b": g.h_over_b,
        "gsd_m": g.gsd_m,
        "cm_per_um": g.cm_per_um,
        "spacing_m": d.spacing,
        "nodes": int(np.isfinite(d.d[..., 2]).sum()),
        **_components(d.d, d.sigma),
        "sigma_includes": sigma_in_words(d.variant, d.change),
        "y_parallax_um": {
            "max": number_or_none(of_known.largest(parallax)),
            "rms": number_or_none(of_known.rms(parallax)),
        },
        "contour_interval_m": contour_interval(low, high),
    }


def block_deformation_json(deformation: BlockDeformation, block: str) -> dict[str, Any]:
    """deform.json of a block."""
    d = deformation
    low, high = of_known.smallest(d.d[..., 2]), of_known.largest(d.d[..., 2])
    return {
        "aerotri": __version__,
        "block": block,
        "kind": "block",
        "title": f"{len(d.models)} models",
        "variant": d.variant,
        "crs": d.crs,
        "ground": d.ground,
        "spacing_m": d.spacing,
        "nodes": int(np.isfinite(d.d[..., 2]).sum()),
        **_components(d.d, d.sigma),
        "sigma_includes": sigma_in_words(d.variant, d.change),
        "contour_interval_m": contour_interval(low, high),
        "models": [_model(k, one, d.number) for k, one in enumerate(d.models)],
        "seams": {
            "count": len(d.seams),
            "nodes": sum(seam.count for seam in d.seams),
            "rms": number_or_none(d.step_rms),
            "worst": [_seam(d, seam) for seam in worst_seams(d)],
        },
    }


def worst_seams(deformation: BlockDeformation) -> list[Seam]:
    """The seams with the largest RMS of the step, corners left out."""
    return [seam for seam in deformation.seams if seam.count >= FEWEST_ON_SEAM][:WORST_SEAMS]


def correction_json(outcome: DemOutcome, models: DemModels, grid: Grid, block: str, dem: str) -> dict[str, Any]:
    """demcor.json."""
    s, n = outcome.sums, max(outcome.sums[0], 1.0)
    sigma = outcome.sigma[np.isfinite(outcome.sigma)]
    return {
        "aerotri": __version__,
        "block": block,
        "dem": dem,
        "variant": models.restitution.variant,
        "models": [list(names) for names in models.names],
        "cells": grid.rows * grid.columns,
        "corrected": int(s[0]),
        "no_data": int(s[1]),
        "outside_models": int(s[2]),
        "before": {"min": number_or_none(s[10]), "max": number_or_none(s[11]), "mean": s[8] / n if s[0] else None},
        "after": {"min": number_or_none(s[12]), "max": number_or_none(s[13]), "mean": s[9] / n if s[0] else None},
        "dZ": {
            "min": number_or_none(s[6]),
            "max": number_or_none(s[7]),
            "mean": s[4] / n if s[0] else None,
            "rms": float(np.sqrt(s[5] / n)) if s[0] else None,
        },
        "sigma_dZ": {**_statistics(sigma), "cell_m": outcome.sigma_grid.cell_x},
        "sigma_includes": sigma_in_words(models.restitution.variant, models.restitution.change),
        "seams": _steps(outcome, models),
        "accuracy_m": {"fit": FIT_TOLERANCE_M, "tables": models.table_accuracy_m},
        "halo_cells": outcome.halo,
        "timings_s": outcome.seconds,
    }


def _components(d: np.ndarray, sigma: np.ndarray) -> dict[str, Any]:
    out: dict[str, Any] = {f"d{axis}": _statistics(d[..., k]) for k, axis in enumerate("XYZ")}
    return out | {f"sigma_d{axis}": _statistics(sigma[..., k]) for k, axis in enumerate("XYZ")}


def _statistics(values: np.ndarray) -> dict[str, float | None]:
    v = values[np.isfinite(values)]
    if not len(v):
        return {"min": None, "max": None, "mean": None, "rms": None}
    return {"min": float(v.min()), "max": float(v.max()), "mean": float(v.mean()), "rms": float(np.sqrt(np.mean(v**2)))}


def _model(number: int, one: BlockModel, map_of_models: np.ndarray) -> dict[str, Any]:
    left, right = one.model.names
    g = one.geometry
    return {
        "number": number,
        "left": left,
        "right": right,
        "h_over_b": g.h_over_b,
        "end_lap": g.end_lap,
        "cm_per_um": g.cm_per_um,
        "nodes": int((map_of_models == number).sum()),
    }


def _seam(d: BlockDeformation, seam: Seam) -> dict[str, Any]:
    first, second = (list(d.models[k].model.names) for k in (seam.first, seam.second))
    return {
        "first": first, "second": second, "nodes": seam.count, "mean": seam.mean, "rms": seam.rms, "max": seam.max
    }  # fmt: skip


def _steps(outcome: DemOutcome, models: DemModels) -> dict[str, Any]:
    steps = outcome.steps
    rows = []
    enough = np.flatnonzero(steps.count >= FEWEST_ON_SEAM)
    for k in enough[np.argsort(-steps.before[enough, 1] / steps.count[enough], kind="stable")][:WORST_SEAMS]:
        n = steps.count[k]
        first, second = (list(models.names[model]) for model in steps.pair[k])
        row: dict[str, Any] = {"first": first, "second": second, "places": int(n)}
        for when, sums in (("before", steps.before[k]), ("after", steps.after[k])):
            row |= {f"mean_{when}": float(sums[0] / n), f"rms_{when}": float(np.sqrt(sums[1] / n))}
        rows.append(row)
    return {
        "count": len(steps.pair),
        "places": int(steps.count.sum()),
        "rms_before": number_or_none(steps.rms("before")),
        "rms_after": number_or_none(steps.rms("after")),
        "worst": rows,
    }
