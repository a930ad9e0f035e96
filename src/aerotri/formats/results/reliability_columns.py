"""Reliability as columns of our own (``x_…``) beside the residuals; what is not tested is NaN or null."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.formats.text.arrow_compute import arrow_compute
from aerotri.results.adjusted_block import AdjustedBlock, RayEffects
from aerotri.statistics.external_reliability import OF_IMAGE, OF_POINT
from aerotri.statistics.reliability import control_reliability, observation_reliability, ray_reliability

ELEMENTS = ("X", "Y", "Z", "X0", "Y0", "Z0", "omega", "phi", "kappa")


def ray_columns(adjusted: AdjustedBlock) -> dict[str, Any]:
    """Arrow columns of residuals.parquet: τ, marginal detectable error (mm), external reliability, greatest effect."""
    import pyarrow as pa

    numbers, columns = ray_reliability(adjusted), {}
    parts = [("tau", numbers.tau), ("mde", numbers.detectable), ("external", numbers.external)]
    if adjusted.effects is not None:
        parts.append(("effect", adjusted.effects.size))
    for name, values in parts:
        for k, axis in enumerate("xy"):
            columns[f"x_{name}_{axis}"] = pa.array(np.ascontiguousarray(values[:, k]), from_pandas=True)
    if adjusted.effects is not None:
        for k, axis in enumerate("xy"):
            columns[f"x_effect_on_{axis}"] = effect_names(adjusted, adjusted.effects, k)
    return columns


def effect_names(adjusted: AdjustedBlock, effects: RayEffects, axis: int) -> Any:
    """Arrow array (m,) of the unknowns that x (0) or y (1) of the rays acts on most, such as 'Z of point 17'."""
    import pyarrow as pa

    block, code = adjusted.block, np.asarray(effects.unknown[:, axis], dtype=np.int64)
    kinds = [f"{element} of {'point' if k < OF_POINT else 'photo'} " for k, element in enumerate(ELEMENTS)]
    what = pa.array([*kinds, *(str(label) for label in effects.shared)], pa.string())
    names = pa.concat_arrays([pa.array(n.astype(str), pa.string()) for n in (block.points, block.images.names)])
    names = pa.concat_arrays([names, pa.array([""], pa.string())])
    place = np.where(code < OF_POINT, block.image_points.point, len(block.points) + block.image_points.image)
    place = np.where(code < OF_IMAGE, place, len(names) - 1)
    missing = code < 0
    element = what.take(pa.array(np.where(missing, 0, code), mask=missing))
    return arrow_compute().binary_join_element_wise(element, names.take(pa.array(place)), "")


def control_columns(adjusted: AdjustedBlock) -> dict[str, np.ndarray]:
    """Columns of control.csv; the largest effect is on the coordinate itself, and is x_external."""
    numbers, columns = control_reliability(adjusted), {}
    for name, values in (("tau", numbers.tau), ("mde", numbers.detectable), ("external", numbers.external)):
        for k, axis in enumerate("XYZ"):
            columns[f"x_{name}{axis}"] = np.ascontiguousarray(values[:, k])
    return columns


def observation_columns(adjusted: AdjustedBlock) -> dict[str, np.ndarray]:
    """Columns of observations.csv: GNSS, INS and conditions one by one, m and degrees."""
    o, numbers = adjusted.observations, observation_reliability(adjusted)
    if o is None or numbers is None:
        return {}
    unit = np.where(o.group == "attitudes", np.degrees(1.0), 1.0)
    columns = {
        "group": o.group, "label": o.label, "component": o.component, "v": o.v * unit, "sigma": o.sigma * unit,
        "r": o.r, "w": o.w, "tau": numbers.tau, "mde": numbers.detectable * unit, "external": numbers.external,
    }  # fmt: skip
    if o.effect is not None and o.effect_on is not None:
        columns |= {"effect": o.effect, "effect_on": o.effect_on}
    return columns
