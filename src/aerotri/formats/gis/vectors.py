"""What is too small to be seen on a map, drawn larger: error ellipses, and differences at control and check points."""

from __future__ import annotations

import numpy as np

from aerotri.formats.gis.layers import roles_of
from aerotri.formats.results.adjustment import ground_point_columns
from aerotri.formats.results.reliability_columns import control_columns
from aerotri.results.adjusted_block import AdjustedBlock, GroundPointResults
from aerotri.statistics.precision import plan_ellipses
from aerotri.vectors.geopackage_writer import Layer

CORNERS = 36
"""Of the polygon of an ellipse [C]: 0.4 % from it."""
MOST_ELLIPSES = 20_000
"""Drawn [C]: of more points the largest ellipse in each cell of a grid."""
OF_SPACING, OF_BLOCK = 0.25, 0.05
"""Sizes on the map [C]: the median semi-axis over the distance of the ellipses, the 90 % quantile of the vectors over
the diagonal of the block."""
PLAN, HEIGHT = "plan", "height"


def ellipse_layer(adjusted: AdjustedBlock, scale: float | None = None) -> Layer:
    """Error ellipses in plan of the object points (one total σ, 39 %), drawn k times as large.

    Parameters
    ----------
    scale : k; None for one that suits the distance of the points.
    """
    import shapely

    xyz = adjusted.points.xyz
    a, b, azimuth = plan_ellipses(adjusted.points.total_covariance)
    known = np.flatnonzero(np.isfinite(xyz[:, :2]).all(axis=1) & np.isfinite(a))
    chosen = _largest_by_cell(xyz[known, :2], a[known], MOST_ELLIPSES)
    rows = known[chosen]
    k = scale or _ellipse_scale(xyz[rows, :2], a[rows])
    turn = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)[::-1]
    along, across = k * a[rows, None] * np.cos(turn), k * b[rows, None] * np.sin(turn)
    sine, cosine = np.sin(azimuth[rows])[:, None], np.cos(azimuth[rows])[:, None]
    corners = np.stack([along * sine + across * cosine, along * cosine - across * sine], axis=-1)
    polygons = np.array([shapely.Polygon(one) for one in xyz[rows, None, :2] + corners], dtype=object)
    sigma = adjusted.points.total_sigma
    columns = {
        "point": adjusted.block.points[rows], "role": roles_of(adjusted)[rows], "ellipse_a_m": a[rows],
        "ellipse_b_m": b[rows], "ellipse_azimuth_deg": np.degrees(azimuth[rows]), "sigma_Z_m": sigma[rows, 2],
        "k": np.full(len(rows), float(k)),
    }  # fmt: skip
    whole = "" if len(rows) == len(known) else f"; the largest of every cell, {len(rows)} of {len(known)}"
    text = f"Error ellipses in plan (one σ, 39 %), drawn {k:g} times as large{whole}"
    return Layer("error_ellipses", "POLYGON", polygons, columns, text=text)


def vector_layer(adjusted: AdjustedBlock, results: GroundPointResults, name: str, scale: float) -> Layer:
    """Differences adjusted − given, drawn k times as large: in plan as they point, in height northwards where too high.

    Parameters
    ----------
    results : of control or check points. name : 'control' or 'check'. scale : k.
    """
    import shapely

    table = ground_point_columns(adjusted, results) | (control_columns(adjusted) if name == "control" else {})
    xyz, d = adjusted.points.xyz[results.point], results.difference
    plan, height = np.nan_to_num(d[:, :2]), np.column_stack([np.zeros(len(d)), np.nan_to_num(d[:, 2])])
    has_plan, has_height = np.isfinite(d[:, :2]).any(axis=1), np.isfinite(d[:, 2])
    row = np.concatenate([np.flatnonzero(has_plan), np.flatnonzero(has_height)])
    vector = np.concatenate([plan[has_plan], height[has_height]])
    lines = np.full(len(row), None)
    drawn = np.flatnonzero((vector != 0.0).any(axis=1) & np.isfinite(xyz[row, :2]).all(axis=1))
    begin = xyz[row[drawn], :2]
    if len(drawn):
        lines[drawn] = shapely.linestrings(np.stack([begin, begin + scale * vector[drawn]], axis=1))
    columns = {"component": np.repeat([PLAN, HEIGHT], [has_plan.sum(), has_height.sum()])}
    columns |= {key: values[row] for key, values in table.items()}
    columns |= {axis: xyz[row, k] for k, axis in enumerate("XYZ")} | {"k": np.full(len(row), float(scale))}
    text = f"Adjusted − given at the {name} points, drawn {scale:g} times as large; heights northwards where too high"
    return Layer(f"{name}_vectors", "LINESTRING", lines, columns, text=text)


def vector_scale(adjusted: AdjustedBlock) -> float:
    """k with which the larger ones of the differences at control and check points are easily seen; 1 without any."""
    d = np.concatenate([adjusted.control.difference, adjusted.check.difference])
    lengths = np.concatenate([np.hypot(d[:, 0], d[:, 1]), np.abs(d[:, 2])])
    lengths = lengths[np.isfinite(lengths) & (lengths > 0.0)]
    places = np.concatenate([adjusted.images.centre[:, :2], adjusted.points.xyz[:, :2]])
    places = places[np.isfinite(places).all(axis=1)]
    if not len(lengths) or len(places) < 2:
        return 1.0
    low, high = np.quantile(places, (0.01, 0.99), axis=0)
    return round_scale(OF_BLOCK * float(np.hypot(*(high - low))) / float(np.quantile(lengths, 0.9)))


def round_scale(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above a value; 1 for what is no number."""
    if not (np.isfinite(value) and value > 0.0):
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(f"{max(step for step in (1.0, 2.0, 5.0) if step * power <= value * (1.0 + 1e-9)) * power:g}")


def _ellipse_scale(xy: np.ndarray, a: np.ndarray) -> float:
    if len(xy) < 2 or not np.median(a) > 0.0:
        return 1.0
    low, high = np.quantile(xy, (0.01, 0.99), axis=0)
    return round_scale(OF_SPACING * float(np.sqrt((high - low).prod() / len(xy))) / float(np.median(a)))


def _largest_by_cell(xy: np.ndarray, a: np.ndarray, most: int) -> np.ndarray:
    """Rows of all positions (n, 2) m, or, of more than `most`, of that with the largest a in every cell of a grid."""
    if len(xy) <= most:
        return np.arange(len(xy))
    low, high = xy.min(axis=0), xy.max(axis=0)
    cell = max(float(np.sqrt((high - low).prod() / most)), float((high - low).max()) / most)
    columns = int((high[0] - low[0]) / cell) + 1
    number = ((xy[:, 1] - low[1]) / cell).astype(np.int64) * columns + ((xy[:, 0] - low[0]) / cell).astype(np.int64)
    order = np.lexsort((-a, number))
    _, first = np.unique(number[order], return_index=True)
    return np.sort(order[first])
