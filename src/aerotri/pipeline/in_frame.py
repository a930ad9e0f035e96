"""An adjustment in the local frame of its block, and the result in its CRS."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.blocks import frame_of_block, needs_positions, transform_block
from aerotri.coordinates.metric import outside_in_words
from aerotri.diagnosis.doubts import failure
from aerotri.observations import Block
from aerotri.pipeline.local import Report, adjust_local
from aerotri.results.adjustment import Adjustment
from aerotri.results.in_crs import transform_result
from aerotri.strategies.removal import with_datum_of
from aerotri.strategies.selection import with_findings_of

FRAME_ROUNDS = 2
"""Adjustments after the first one where a coordinate's place in the local frame depends on the adjusted position."""


def adjust_in_frame(
    block: Block, report: Report | None, given_points: np.ndarray | None, geoid: FilePath | None
) -> Adjustment:
    if block.crs == "local":
        return adjust_local(block, report, given_points)
    frame = frame_of_block(block, geoid)
    points = None if given_points is None else frame.to_local(given_points)
    outside = outside_in_words(frame)
    found = adjust_local(transform_block(block, frame), report, points)
    for _ in range(FRAME_ROUNDS if needs_positions(block) else 0):
        local = transform_block(block, frame, found.local.points.xyz, found.local.images.centre)
        found = adjust_local(local, report, found.local.points.xyz)
    if outside:
        outcome = found.local.outcome
        local = replace(found.local, outcome=replace(outcome, warnings=(outside, *outcome.warnings)))
        found = replace(found, local=local)
    used = with_findings_of(with_datum_of(block, found.local.block), found.local.block)
    try:
        result = transform_result(found.local, used, frame)
    except InputError as error:
        raise failure(
            found.system,
            "not converged",
            f"coordinates left the range of the coordinate system: {error}",
            found.solution.iterations,
        ) from error
    return replace(found, result=result, frame=frame)
