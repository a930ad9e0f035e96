"""Pictures of the model deformation: what is drawn is what was computed."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.contour import ContourSet

from aerotri.deformation import Deformation
from aerotri.deformation.model_geometry import ModelGeometry
from aerotri.formats.results.deformation import contour_interval
from aerotri.report.plots.deformation import plot_deformation, plot_deformation_profile


def deformation(names=("1_001", "1_002"), step=0.3):
    """dZ rising by 1 cm a metre to the east, with a step at x = 100 m where two tiles meet."""
    x, y = np.arange(0.0, 201.0, 10.0), np.arange(120.0, -1.0, -10.0)
    grid_x, grid_y = np.meshgrid(x, y)
    d = np.stack([0.001 * grid_y, np.full(grid_x.shape, 0.02), 0.01 * (grid_x - 60.0)], axis=-1)
    region = (grid_x > 100.0).astype(int)
    d[..., 2] += step * region
    d[:2, :3] = np.nan
    return Deformation(
        title="pair 1_001, 1_002", variant="free", names=names, group="ucd",
        geometry=ModelGeometry(22.75, 80.0, 356.8, 0.663, 0.09), crs="local", ground="flat", x=x, y=y,
        z=np.zeros(grid_x.shape), d=d, sigma=np.full(d.shape, 0.015), parallax=np.zeros(grid_x.shape),
        region=np.where(np.isfinite(d[..., 2]), region, -1), base=np.array([[60.0, 60.0], [140.0, 60.0]]),
        seams=(np.array([[105.0, 0.0], [105.0, 120.0]]),),
    )  # fmt: skip


def lines_of(axes: Axes) -> dict[float, np.ndarray]:
    """Vertices of the contour lines by level, cm."""
    found: dict[float, list[np.ndarray]] = {}
    for contours in axes.collections:
        if isinstance(contours, ContourSet):
            for level, path in zip(contours.levels, contours.get_paths(), strict=True):
                found.setdefault(float(level), []).append(np.asarray(path.vertices))
    return {level: np.concatenate(parts) for level, parts in found.items() if sum(map(len, parts))}


def test_interval_is_five_or_ten_centimetres_by_range():
    for span, interval in ((1.2, 0.05), (0.7, 0.05), (2.2, 0.1), (0.3, 0.02), (4.0, 0.2), (1e3, 10.0)):
        assert contour_interval(-span / 3.0, span * 2.0 / 3.0) == interval


def test_contours_lie_where_the_heights_are():
    """Each line at its own x, on either side of the step its own, and none across it."""
    figure = plot_deformation(deformation(), "sample")
    axes = figure.axes[0]
    lines = lines_of(axes)
    assert min(lines) == -60.0
    for level, vertices in lines.items():
        for side, shift in ((vertices[:, 0] <= 100.0, 0.0), (vertices[:, 0] >= 110.0, 30.0)):
            np.testing.assert_allclose(vertices[side, 0], 60.0 + level - shift, atol=1e-6)
    assert not any(((v[:, 0] > 100.0) & (v[:, 0] < 110.0)).any() for v in lines.values())
    seams = [c for c in axes.collections if isinstance(c, LineCollection) and not isinstance(c, ContourSet)]
    np.testing.assert_array_equal(seams[0].get_segments()[0], [[105.0, 0.0], [105.0, 120.0]])
    said = " ".join(text.get_text() for text in figure.texts)
    for part in ("pair 1_001, 1_002", "free", "h/b 4.46", "end lap 66.3 %", "+170.0 cm", "mean σ 1.5 cm", "val 10 cm"):
        assert part in said, part


def test_normal_case_has_the_flight_upwards():
    axes = plot_deformation(deformation(names=None), "sample").axes[0]
    assert axes.get_ylabel() == "along the flight [m]"
    # X of the model, along the flight, is up; its Y is to the left
    level = lines_of(axes)[-30.0]
    np.testing.assert_allclose(level[:, 1], 30.0, atol=1e-6)


def test_profile_through_the_middle_of_the_base():
    figure = plot_deformation_profile(deformation(), "sample")
    along, across = figure.axes
    dz = along.lines[2]
    at = np.asarray(dz.get_xdata(), dtype=float)
    values = np.asarray(dz.get_ydata(), dtype=float)
    left = at <= 0.0
    np.testing.assert_allclose(values[left], at[left] + 40.0, atol=1e-6)
    assert np.interp(50.0, at, values) == pytest.approx(120.0)
    np.testing.assert_allclose(np.asarray(across.lines[2].get_ydata(), dtype=float), 40.0, atol=1e-6)
    assert across.get_xlabel().startswith("across the base")
