"""The page about a block in parts: that of a block in one piece, with the parts side by side.

Numbers, control and check points, photographs and the extremes are of all rays; plots of points and rays, and what
points have in the mean, of a sample where there are many.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from aerotri.partition.whole import Whole
from aerotri.report.pages.adjustment import Findings, filled_page, page_content
from aerotri.report.plots.overview import all_plots
from aerotri.report.plots.rendering import RenderedPlot, render_plots
from aerotri.report.quality import metre_digits
from aerotri.report.tables import adjustment as tables
from aerotri.report.tables import photographs as photograph_tables
from aerotri.report.tables.adjustment import Column, Table, table
from aerotri.results.adjusted_block import AdjustedBlock

MOST_DRAWN = 20_000
"""Photographs of the plan and the plots [C]: with more nobody tells one from another."""


def parts_plots(whole: Whole) -> dict[str, Figure]:
    """The figures of the page, by the names of `all_plots`."""
    sample, rows = _drawn(whole)
    of_photographs = whole.picture.residuals.take(rows)
    return all_plots(sample, of_photographs=of_photographs)


def parts_html(whole: Whole, plots: Mapping[str, Figure | RenderedPlot]) -> str:
    """The page as text.

    Parameters
    ----------
    plots : of `parts_plots`, drawn or already rendered.
    """
    picture, record = whole.picture, whole.record
    drawn, _ = _drawn(whole)
    everything = replace(picture.sample, outcome=record.outcome)
    content = page_content(drawn, render_plots(plots), Findings(picture.work, lights=picture.lights))
    content["tables"] |= {
        "summary": _summary(whole, content["tables"]["summary"]),
        "parts": parts_table(whole),
        "largest": tables.largest_residuals(picture.extremes),
        "weak_points": tables.weak_points(picture.extremes),
        "weak_images": tables.weak_images(everything),
        "images": tables.images(everything),
        "photograph_residuals": photograph_tables.photograph_residuals_table(picture.residuals, everything),
    }
    content["sampled"] = _sampled(whole, drawn)
    return filled_page(content)


def write_parts_report(whole: Whole, plots: Mapping[str, Figure | RenderedPlot], path: Path) -> None:
    """Write the page; arguments as in `parts_html`."""
    path.write_text(parts_html(whole, plots), encoding="utf-8")


def parts_table(whole: Whole) -> Table:
    """The parts side by side; every number is of all rays of the part."""
    rows = whole.picture.parts
    digits = metre_digits(np.array([row.sigma for row in rows]))
    model = whole.record.model_part
    total = "total " if model is not None and model.counts else ""
    return table(
        "The parts",
        (Column("part"), [row.name for row in rows]),
        (Column("verdict"), [row.verdict for row in rows]),
        (Column("photographs", "", "d"), [row.photographs for row in rows]),
        (Column("of these shared", "", "d"), [row.shared for row in rows]),
        (Column("points", "", "d"), [row.points for row in rows]),
        (Column("rays", "", "d"), [row.rays for row in rows]),
        (Column("largest |w|", "", ".1f"), [row.largest_w for row in rows]),
        (Column("rays beyond the test", "", "d"), [row.beyond for row in rows]),
        *(
            (Column(f"{total}σ{axis}, median", "m", f".{digits}f"), [row.sigma[k] for row in rows])
            for k, axis in enumerate("XYZ")
        ),
    )


def _summary(whole: Whole, found: Table) -> Table:
    """What was adjusted, with the numbers of the whole."""
    exact: dict[str, Any] = {
        "photographs": f"{whole.photographs}, camera {found.rows[0][1].partition('camera ')[2]}",
        "object points": f"{whole.points}",
        "rays": f"{whole.rays}",
    }
    rows = [(item, exact.get(item, value)) for item, value in found.rows]
    return replace(found, rows=(("parts", f"{len(whole.parts)}"), *rows))


def _sampled(whole: Whole, drawn: AdjustedBlock) -> str:
    """What plots and means of points show where they do not show all; '' where they do."""
    said = []
    if whole.picture.every > 1:
        rays, points = len(drawn.block.image_points), len(drawn.block.points)
        said.append(
            f"Plots of residuals and of points, and means over points, show a sample: {points} of {whole.points} "
            f"points with {rays} rays, chosen by their names, and all control and check points. All other numbers are "
            "of all rays."
        )
    if len(drawn.block.images) < whole.photographs:
        said.append(f"Plans show {len(drawn.block.images)} of {whole.photographs} photographs.")
    return " ".join(said)


def _drawn(whole: Whole) -> tuple[AdjustedBlock, np.ndarray]:
    """The sample with no more photographs than can be drawn, and the rows of these."""
    sample = replace(whole.picture.sample, outcome=whole.record.outcome)
    n = len(sample.block.images)
    rows = np.arange(0, n, max(1, -(-n // MOST_DRAWN)))
    if len(rows) == n:
        return sample, rows
    block, rays, results, found = sample.block, sample.block.image_points, sample.rays, sample.images
    row = np.full(n, -1)
    row[rows] = np.arange(len(rows))
    own, gnss = row[rays.image] >= 0, block.gnss_ins
    if gnss is not None:
        there = row[gnss.image] >= 0
        gnss = replace(
            gnss, image=row[gnss.image[there]],
            **{key: getattr(gnss, key)[there] for key in ("xyz", "sigma", "angles", "angles_sigma", "time")},
        )  # fmt: skip
    block = replace(
        block,
        images=block.images.take(rows),
        image_points=replace(
            rays, image=row[rays.image[own]], point=rays.point[own], xy=rays.xy[own], sigma=rays.sigma[own]
        ),
        gnss_ins=gnss,
    )
    keys = ("v", "r", "w", "weight", "status")
    return replace(
        sample,
        block=block,
        images=replace(
            found, centre=found.centre[rows], angles=found.angles[rows], covariance=found.covariance[rows],
            rays=found.rays[rows], model=None if found.model is None else found.model[rows],
        ),
        rays=replace(results, **{key: getattr(results, key)[own] for key in keys}),
    ), rows  # fmt: skip
