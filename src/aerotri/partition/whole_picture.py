"""What the page of a block in parts shows: all photographs, a sample of the points, extremes, the single parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.diagnosis import check_points
from aerotri.diagnosis.finding import Finding
from aerotri.diagnosis.work_list import WorkList, joined
from aerotri.partition.part_picture import PartPicture, rows_of_parts, sums_together, together
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.photograph_residuals import PhotographResiduals, residuals_of

LEVELS = ("good", "note", "attention")


@dataclass(frozen=True, eq=False)
class PartRow:
    """A part among the others: a row of the table of parts.

    Parameters
    ----------
    photographs, shared, points, rays : how many. largest_w : of an image coordinate.
    beyond : rays whose |w| exceeds the test. sigma : (3,) m, median of the points.
    verdict : 'accepted', 'doubtful' or 'rejected'.
    """

    name: str
    photographs: int
    shared: int
    points: int
    rays: int
    largest_w: float
    beyond: int
    sigma: np.ndarray
    verdict: str


@dataclass(frozen=True, eq=False)
class WholePicture:
    """What the page shows.

    Parameters
    ----------
    sample : the whole with all photographs, and one point of `every` with all its rays; all control and check points.
    extremes : the same with the points of the largest residuals and σ of every part.
    residuals : of the photographs, from all rays.
    lights : what the parts are judged by, the worst of each; check points of the whole. work : what to look at.
    """

    sample: AdjustedBlock
    extremes: AdjustedBlock
    residuals: PhotographResiduals
    lights: tuple[Finding, ...]
    work: WorkList
    parts: tuple[PartRow, ...]
    every: int


def whole_picture(
    record: AdjustedBlock, pictures: Sequence[PartPicture], rows: Sequence[PartRow], every: int
) -> WholePicture:
    """The picture of the whole.

    Parameters
    ----------
    record : of the whole, without photographs and rays. every : one point of so many is in the samples.
    """
    sample = together(record, [one.sample for one in pictures])
    sums = sums_together(
        [one.sums for one in pictures], rows_of_parts([one.sample for one in pictures]), len(sample.block.images)
    )
    return WholePicture(
        sample, together(record, [one.extremes for one in pictures]), residuals_of(sums),
        _lights(record, [one.name for one in rows], [one.lights for one in pictures]),
        joined([one.work for one in pictures]), tuple(rows), every,
    )  # fmt: skip


def _lights(record: AdjustedBlock, names: Sequence[str], of_parts: Sequence[Sequence[Finding]]) -> tuple[Finding, ...]:
    """Every number of the parts where it is worst, with the part; what concerns check points is of the whole."""
    whole = [*check_points.of_check_points(record), *check_points.of_means(record)]
    of_whole = {finding.quantity for finding in whole}
    found: dict[str, list[tuple[str, Finding]]] = {}
    for name, lights in zip(names, of_parts, strict=True):
        for finding in lights:
            if finding.quantity not in of_whole:
                found.setdefault(finding.quantity, []).append((name, finding))
    return (*whole, *(_worst(own) for own in found.values()))


def _worst(found: Sequence[tuple[str, Finding]]) -> Finding:
    """One number of several parts: that of the first part where it is worst."""
    name, worst = max(found, key=lambda one: LEVELS.index(one[1].level))
    if all((one.value, one.says) == (worst.value, worst.says) for _, one in found):
        return worst
    if worst.level == "good":
        return replace(worst, value=f"different in {len(found)} parts, good in all", says="as it should be")
    alike = sum(one.level == worst.level for _, one in found)
    where = f"part {name}" + (f", and {alike - 1} more of {len(found)}" if alike > 1 else "")
    return replace(worst, value=f"{worst.value} ({where})")
