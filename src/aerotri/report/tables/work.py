"""Tables of what to look at: the work list, the rays of control points one by one, the free adjustment."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.ray_status import RAY_STATUS
from aerotri.conventions import MGON_PER_RADIAN
from aerotri.diagnosis.control_rays import control_rays
from aerotri.diagnosis.free_verdict import in_words, suspect_text
from aerotri.diagnosis.work_items import KINDS, PRIORITIES
from aerotri.diagnosis.work_list import WorkList
from aerotri.report.quality import metre_digits
from aerotri.report.tables.adjustment import MOST_ROWS, Column, Table, table
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.strategies.free_stages import FreeCheck

KIND_TITLES = {
    "left out": "left out",
    "control": "control coordinate",
    "check point": "check point",
    "control ray": "control ray",
    "ray": "ray",
    "observation": "observation",
    "part": "weakly tied part",
    "photograph": "photograph",
    "parameters": "parameters",
    "point": "point",
}


def work_table(work: WorkList) -> Table:
    """What to look at, first things first."""
    items = work.items
    return table(
        "What to look at first",
        (Column("", "", "d"), range(1, len(items) + 1)),
        (Column("level"), [PRIORITIES[item.priority - 1] for item in items]),
        (Column("kind"), [KIND_TITLES[item.kind] for item in items]),
        (Column("where"), [item.where for item in items]),
        (Column("what"), [item.what for item in items]),
        (Column("× limit", "", ".1f"), [item.severity for item in items]),
        (Column("do"), [item.hint for item in items]),
    )


def work_counts(work: WorkList) -> str:
    """How many items there are of each kind, and how many of them are listed; '' without any."""
    if not work.found:
        return ""
    counts = [f"{work.found[kind]} {_several(kind, work.found[kind])}" for kind in KINDS if work.found.get(kind)]
    listed = f"; {len(work.items)} of {sum(work.found.values())} are listed" if work.unlisted else ""
    return f"Found: {', '.join(counts)}{listed}."


def _several(kind: str, count: int) -> str:
    title = KIND_TITLES[kind]
    return title if count == 1 or kind in ("left out", "parameters") else f"{title}s"


def control_rays_table(adjusted: AdjustedBlock) -> Table:
    """Every ray of every control and check point, the point with the largest |w| first."""
    block, rays = adjusted.block, control_rays(adjusted)
    title = "Rays of control and check points, one by one"
    if len(rays) > MOST_ROWS:
        title += f", the first {MOST_ROWS} of {len(rays)} (all: residuals.parquet)"
    shown = slice(0, MOST_ROWS)
    rows = rays.row[shown]
    ray = block.image_points
    return table(
        title,
        (Column("point"), block.points[ray.point[rows]]),
        (Column("role"), rays.role[shown]),
        (Column("photograph"), block.images.names[ray.image[rows]]),
        (Column("wx", "", "+.1f"), rays.w[shown, 0]),
        (Column("wy", "", "+.1f"), rays.w[shown, 1]),
        (Column("vx", "px", "+.2f"), rays.v_px[shown, 0]),
        (Column("vy", "px", "+.2f"), rays.v_px[shown, 1]),
        (Column("rx", "", ".2f"), rays.r[shown, 0]),
        (Column("ry", "", ".2f"), rays.r[shown, 1]),
        (Column("error x", "px", "+.1f"), rays.error_px[shown, 0]),
        (Column("error y", "px", "+.1f"), rays.error_px[shown, 1]),
        (Column("status"), np.array(RAY_STATUS)[adjusted.rays.status[rows]]),
    )


def stages_table(check: FreeCheck) -> Table:
    """The adjustments of a free check, what each added and whether it fits."""
    stages = check.stages
    verdicts = ["–", *("fits" if s.fits else "does not fit" if s.tested else "not tested" for s in stages[1:])]
    return table(
        "From the free block to the whole",
        (Column("adjustment"), [s.name for s in stages]),
        (Column("status"), [s.status for s in stages]),
        (Column("σ₀", "", ".3f"), [s.sigma0 for s in stages]),
        (Column("redundancy", "", "d"), [s.redundancy for s in stages]),
        (Column("vᵀPv", "", ".1f"), [s.vtpv for s in stages]),
        (Column("growth / σ₀²", "", ".2f"), [s.ratio for s in stages]),
        (Column("at most", "", ".2f"), [s.limit for s in stages]),
        (Column("largest |w|", "", ".1f"), [s.largest_w for s in stages]),
        (Column("at most", "", ".1f"), [s.w_limit for s in stages]),
        (Column("verdict"), verdicts),
    )


def suspects_table(check: FreeCheck) -> Table:
    """The values that contradict the rest, stage by stage."""
    rows = [(stage.name, suspect_text(suspect)) for stage in check.stages for suspect in stage.suspects]
    return Table("Values that contradict", (Column("adjustment"), Column("value")), tuple(rows))


def similarity_table(check: FreeCheck) -> Table:
    """Control points of the free block, moved, turned and scaled onto their given coordinates."""
    if check.similarity is None:
        return Table("The free block on the control", (Column("point"),), ())
    residual = check.similarity.residual
    digits = metre_digits(np.abs(residual[np.isfinite(residual)]))
    names = [*check.point, "RMS"]
    values = np.vstack([residual, check.similarity.rms])
    return table(
        "The free block on the control",
        (Column("point"), names),
        *((Column(f"d{axis}", "m", f"+.{digits}f"), values[:, k]) for k, axis in enumerate("XYZ")),
    )


def similarity_text(check: FreeCheck) -> str:
    """The seven parameters of the transformation in a sentence, '' where there is none."""
    s = check.similarity
    if s is None:
        return "The control does not determine a transformation of the free block." if len(check.point) else ""
    turn = ", ".join(f"{value:+.2f}" for value in s.rotation * MGON_PER_RADIAN)
    scale = f"{round((s.scale - 1.0) * 1e6, 1) + 0.0:+.1f} ppm"
    return (
        f"Residuals (transformed − given) after a transformation by seven parameters: turned by {turn} mgon about "
        f"X, Y, Z, scale {scale}; redundancy {s.redundancy}. Beside errors of the control they hold the deformation of "
        "a block that nothing holds, heights above all."
    )


def free_check_lines(check: FreeCheck) -> list[str]:
    """The free check in a few lines for a terminal."""
    return [f"free adjustment: {check.verdict}", *(f"  {text}." for text in in_words(check).rstrip(".").split(". "))]
