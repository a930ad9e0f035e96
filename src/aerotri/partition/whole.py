"""The result of a block in parts: what its parts say together, and its tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.diagnosis.finding import GRADES
from aerotri.diagnosis.moving_errors import model_part_in_words
from aerotri.formats.results.adjustment import adjustment_json, ground_point_columns, parameter_columns, write_csv
from aerotri.formats.results.evaluation import work_columns
from aerotri.formats.results.json_text import write_json
from aerotri.observations import Block
from aerotri.observations.block import Control
from aerotri.partition.part_results import GroundPoints, Written
from aerotri.partition.whole_picture import PartRow, WholePicture, whole_picture
from aerotri.results.adjusted_block import (
    AdjustedBlock,
    Blunder,
    GroundPointResults,
    ImageResults,
    ObservationGroup,
    Outcome,
    PointResults,
    RayResults,
    SharedParameters,
)
from aerotri.results.model_part import ModelPart

NOT_LOOKED_FOR = (
    "Not looked for, because the block was adjusted in parts: weak points to be set aside, GNSS errors that stay for "
    "seconds to minutes, the effect of additional parameters on check points"
)
PARTS = "parts"
"""Folder of the parts in a block and in a result."""
MOST_BLUNDERS, MOST_REASONS = 100, 10
"""Suspected gross errors, and reasons, of the whole that are listed; those of the parts have all."""


@dataclass(frozen=True, eq=False)
class Whole:
    """A block in parts after its adjustment.

    Parameters
    ----------
    record : status, σ0, parameters, control and check points of the whole; its photographs, points and rays stand in
        the folders of the parts.
    parts : names. photographs, points, rays : how many in all. picture : what its page shows.
    """

    record: AdjustedBlock
    parts: tuple[str, ...]
    photographs: int
    points: int
    rays: int
    picture: WholePicture

    @property
    def outcome(self) -> Outcome:
        return self.record.outcome


def whole_of(
    first: Block, outcome: Outcome, parameters: SharedParameters, written: Sequence[Written], photographs: int,
    every: int, model_part: ModelPart,
) -> Whole:  # fmt: skip
    """What the parts say together.

    Parameters
    ----------
    first : a part, for cameras and settings. outcome : without verdict. every : see `WholePicture`.
    """
    control, of_control = _ground_points([part.control for part in written], is_check=False, first=0)
    check, of_check = _ground_points([part.check for part in written], is_check=True, first=len(control.point))
    points = np.concatenate([p.control.names for p in written] + [p.check.names for p in written])
    adjusted = np.concatenate([p.control.adjusted for p in written] + [p.check.adjusted for p in written])
    worst = max((part.verdict for part in written), key=GRADES.index)
    names = tuple(part.name for part in written)
    reasons = [f"part {part.name}: {said}" for part in written for said in part.reasons]
    block = _block_of_all(first, points, control, check)
    count_points, count_rays = sum(part.points for part in written), sum(part.rays for part in written)
    note = f"adjusted in {len(names)} parts: {photographs} photographs, {count_points} points, {count_rays} rays"
    record = AdjustedBlock(
        block=block,
        outcome=replace(
            outcome,
            verdict=worst,
            reasons=tuple(reasons[:MOST_REASONS]),
            notes=(note, NOT_LOOKED_FOR),
            warnings=tuple(text for text in (model_part_in_words(model_part),) if text),
        ),
        images=ImageResults(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 6, 6)), np.zeros(0, dtype=np.int64)),
        points=PointResults(adjusted, np.zeros((len(points), 3, 3)), np.zeros(len(points), int), np.zeros(len(points))),
        rays=RayResults(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), np.zeros(0, np.int8)),
        parameters=parameters,
        control=of_control,
        check=of_check,
        groups=_groups(written),
        blunders=_largest(written),
        model_part=model_part,
    )
    picture = whole_picture(record, [one.picture for one in written], _part_rows(written), every)
    return Whole(record, names, photographs, count_points, count_rays, picture)


def _block_of_all(first: Block, points: np.ndarray, control: Control, check: Control) -> Block:
    """A block of the ground points alone, `points` (n,) their names, without photographs and image points."""
    nothing = np.zeros(0, dtype=np.int64)
    return replace(
        first,
        name=first.name.rpartition(" part ")[0] or first.name,
        images=replace(
            first.images, names=first.images.names[:0], camera=nothing, strip=first.images.strip[:0],
            centre=np.zeros((0, 3)), angles=np.zeros((0, 3)), columns={},
        ),
        points=points.astype(str),
        image_points=replace(
            first.image_points, image=nothing, point=nothing, xy=np.zeros((0, 2)), sigma=np.zeros((0, 2))
        ),
        control=Control(
            np.arange(len(points)), np.concatenate([control.xyz, check.xyz]),
            np.concatenate([control.sigma, check.sigma]), np.concatenate([control.is_check, check.is_check]),
        ),
        gnss_ins=None,
    )  # fmt: skip


def _part_rows(written: Sequence[Written]) -> list[PartRow]:
    return [
        PartRow(
            one.name, one.picture.photographs, one.picture.shared, one.points, one.rays, one.picture.largest_w,
            one.picture.beyond, one.picture.sigma, one.verdict,
        )
        for one in written
    ]  # fmt: skip


def write_whole(whole: Whole, folder: Path) -> None:
    """adjustment.json, parameters.csv, control.csv, check.csv and work_list.csv beside the folder of the parts."""
    record = whole.record
    write_csv(folder / "parameters.csv", parameter_columns(record))
    write_csv(folder / "control.csv", ground_point_columns(record, record.control))
    write_csv(folder / "check.csv", ground_point_columns(record, record.check))
    write_csv(folder / "work_list.csv", work_columns(whole.picture.work))
    write_json(folder / "adjustment.json", whole_json(whole))


def whole_json(whole: Whole) -> dict[str, Any]:
    """The content of adjustment.json, with the keys of an adjustment in one piece."""
    return adjustment_json(whole.record)


def _ground_points(parts: Sequence[GroundPoints], is_check: bool, first: int) -> tuple[Control, GroundPointResults]:
    count = sum(len(part.names) for part in parts)
    point = first + np.arange(count)
    control = Control(
        point, np.concatenate([part.xyz for part in parts]), np.concatenate([part.sigma for part in parts]),
        np.full(count, is_check),
    )  # fmt: skip
    found = [part.results for part in parts]
    of_model = [one.model_sigma for one in found if one.model_sigma is not None]
    return control, GroundPointResults(
        point,
        *(np.concatenate([getattr(one, key) for one in found]) for key in ("difference", "sigma", "r", "w", "rays")),
        model_sigma=np.concatenate(of_model) if len(of_model) == len(found) else None,
    )


def _groups(written: Sequence[Written]) -> tuple[ObservationGroup, ...]:
    """Groups of observations of the same name added up; σ of each from the squares and the redundancy of all."""
    by_name: dict[str, list[ObservationGroup]] = {}
    for part in written:
        for group in part.groups:
            by_name.setdefault(group.name, []).append(group)
    return tuple(_added(groups) for groups in by_name.values())


def _added(groups: list[ObservationGroup]) -> ObservationGroup:
    count = np.array([group.count for group in groups])
    redundancy = np.array([group.redundancy for group in groups])
    apriori = float(np.average([group.sigma_apriori for group in groups], weights=count))
    squares = sum(
        (g.sigma_aposteriori / g.sigma_apriori) ** 2 * g.redundancy for g in groups if np.isfinite(g.sigma_aposteriori)
    )
    posteriori = apriori * float(np.sqrt(squares / redundancy.sum())) if redundancy.sum() > 1e-9 else np.nan
    rms = float(np.sqrt(np.average(np.square([group.rms for group in groups]), weights=count)))
    return ObservationGroup(groups[0].name, int(count.sum()), apriori, rms, float(redundancy.sum()), posteriori)


def _largest(written: Sequence[Written]) -> tuple[Blunder, ...]:
    found = [blunder for part in written for blunder in part.blunders]
    return tuple(sorted(found, key=lambda blunder: -abs(blunder.w))[:MOST_BLUNDERS])
