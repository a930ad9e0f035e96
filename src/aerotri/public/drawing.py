"""The look of the package's plots, for figures of one's own.

`styled` draws a function's figure with that look; `new_figure` and `axes_at` place axes in inches; `plot_panels` lays
image errors or averaged residuals side by side on one scale; `draw_contours` draws the deformation of a model.

>>> from aerotri import drawing
>>> @drawing.styled
... def draw():
...     figure = drawing.new_figure(3.0, "Heights", "along the strip")
...     drawing.axes_at(figure, 0.8, 0.6, 5.0, 1.6).plot([0, 1, 2], [3, 1, 2], color=drawing.INK)
...     return figure
>>> draw().get_size_inches().tolist()
[8.6, 3.0]
"""

from aerotri.formats.results.deformation import contour_interval
from aerotri.report.plots.camera import seams
from aerotri.report.plots.canvas import (
    ACCENT,
    GREY,
    INK,
    LIGHT,
    WIDTH,
    axes_at,
    length_text,
    new_figure,
    per_inch_for,
    scale_vector,
    styled,
    vectors,
)
from aerotri.report.plots.deformation import contour_symbols, draw_contours, panel_size
from aerotri.report.plots.panels import Panel, plot_panels
from aerotri.report.plots.rendering import save_plots

__all__ = [
    "ACCENT", "GREY", "INK", "LIGHT", "WIDTH", "Panel", "axes_at", "contour_interval", "contour_symbols",
    "draw_contours", "length_text", "new_figure", "panel_size", "per_inch_for", "plot_panels", "save_plots",
    "scale_vector", "seams", "styled", "vectors",
]  # fmt: skip
