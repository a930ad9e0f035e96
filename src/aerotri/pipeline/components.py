"""The σ of whole groups, estimated by adjusting again and again."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from aerotri.conventions import FilePath
from aerotri.observations import Block
from aerotri.pipeline.in_frame import adjust_in_frame
from aerotri.pipeline.local import Report
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.observation_groups import with_scaled_sigmas
from aerotri.strategies.removal import with_datum_of
from aerotri.strategies.selection import with_findings_of
from aerotri.strategies.variance_components import Fitted, estimate_components, in_words, with_components


def with_variance_components(
    block: Block, first: Adjustment, report: Report | None, geoid: FilePath | None
) -> Adjustment:
    """The adjustment with the σ of every group estimated; the block of the result has these σ."""
    latest, used = first, block
    timings = [dict(first.result.outcome.timings_s)]

    def readjust(factors: Mapping[str, float]) -> Fitted:
        nonlocal latest, used
        used = with_scaled_sigmas(block, factors)
        latest = adjust_in_frame(_continued(used, latest.result), report, latest.result.points.xyz, geoid)
        timings.append(dict(latest.result.outcome.timings_s))
        return Fitted(latest.local, latest.system, latest.solution)

    started = time.perf_counter()
    components, _ = estimate_components(Fitted(first.local, first.system, first.solution), readjust)
    readjusting = sum(sum(round_.values()) for round_ in timings[1:])
    seconds = {stage: sum(round_.get(stage, 0.0) for round_ in timings) for stage in timings[0]}
    seconds["statistics"] += time.perf_counter() - started - readjusting
    said = (*latest.result.outcome.warnings, *in_words(components))
    outcome = replace(latest.result.outcome, warnings=said, timings_s=seconds)
    # the rounds began at what was adjusted; the block keeps the orientations that were given
    given = replace(latest.local.block, images=first.local.block.images)
    local = replace(with_components(latest.local, components), outcome=outcome, block=given)
    delivered = with_findings_of(with_datum_of(used, latest.result.block), latest.result.block)
    result = replace(latest.result, groups=local.groups, components=components, outcome=outcome, block=delivered)
    return replace(latest, result=result, local=local if latest.frame is not None else result)


def _continued(block: Block, result: AdjustedBlock) -> Block:
    """The block with what was adjusted as start values."""
    images, found = block.images, result.images
    there = np.isfinite(found.centre).all(axis=1, keepdims=True)
    centre, angles = np.where(there, found.centre, images.centre), np.where(there, found.angles, images.angles)
    return replace(block, images=replace(images, centre=centre, angles=angles))
