"""The map of reliability: what it counts, and that it is drawn whatever is missing."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from aerotri.pipeline import adjust
from aerotri.report.plots.overview import all_plots
from aerotri.report.plots.reliability import height_effects, mean_redundancy, plot_reliability
from small_blocks import small_block


@pytest.fixture(scope="module")
def adjusted():
    return adjust(small_block(3)[0])


def text_of(figure):
    canvas = FigureCanvasAgg(figure)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        canvas.draw()
    return [text.get_text() for legend in figure.legends for text in (legend.get_title(), *legend.texts)]


def test_drawn_with_both_legends(adjusted):
    text = text_of(plot_reliability(adjusted))
    assert sum(t.startswith("below") for t in text) == sum(t.startswith("above") for t in text) == 2
    assert any(t.endswith(" m") for t in text)
    assert "reliability" in all_plots(adjusted)


def test_values(adjusted):
    """Of a point the largest of its rays; of a photograph the mean of both coordinates."""
    rays, effect = adjusted.block.image_points, height_effects(adjusted)
    often = int(np.argmax(np.bincount(rays.point)))
    assert effect[often] == adjusted.effects.height[rays.point == often].max()
    assert mean_redundancy(adjusted)[4] == pytest.approx(adjusted.rays.r[rays.image == 4].mean())
    # two rays along the base: nothing controls the height
    assert np.isinf(effect).any()


def test_all_alike_and_nothing_at_all(adjusted):
    same = np.full_like(adjusted.effects.height, 0.5)
    one = replace(adjusted, effects=replace(adjusted.effects, height=same))
    assert "0.5 m" in text_of(plot_reliability(one))
    text_of(plot_reliability(replace(adjusted, effects=None)))
