"""What is doubted of control points and their marks, at start values and at the end of an adjustment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.conventions import FilePath
from aerotri.coordinates.blocks import frame_of_block, transform_block
from aerotri.diagnosis.control_marks import contradictions_in_words, marks_of, rays_that_tell
from aerotri.diagnosis.control_points import doubts_of_control, doubts_with_orientation
from aerotri.diagnosis.suspicions import suspicions_of_lists
from aerotri.formats.assembly.oriented import oriented_from_adjusted
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block, ImagePoints
from aerotri.pipeline.verdict import with_outcome
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.adjustment import Adjustment


def doubts_at_start(block: Block, geoid: FilePath | None = None) -> tuple[str, ...]:
    """Sentences about the control of a block, by the orientations that it gives; in its CRS."""
    known = np.asarray(np.isfinite(np.hstack([block.images.centre, block.images.angles])).all(axis=1))
    if not known.any() or not len(block.control):
        return doubts_of_control(block)
    local = block if block.crs == "local" else transform_block(block, frame_of_block(block, geoid))
    centre = np.where(known[:, None], local.images.centre, np.nan)
    return doubts_with_orientation(block, centre, rotation_from_angles(local.images.angles, local.rotation))


def with_control_doubts(found: Adjustment, given: Block) -> Adjustment:
    """The adjustment with sentences about its control and its lists among the warnings; `given` is in the CRS."""
    outcome = found.result.outcome
    said = (*_of_marks(found.local), *doubts_of_control(given), *suspicions_of_lists(given))
    said = tuple(text for text in said if text not in outcome.warnings)
    return with_outcome(found, replace(outcome, warnings=(*outcome.warnings, *said))) if said else found


def _of_marks(local: AdjustedBlock) -> tuple[str, ...]:
    """By the adjusted orientations and cameras."""
    block, rays = local.block, local.block.image_points
    if not len(block.control) or not len(rays):
        return ()
    rows = rays_that_tell(block)
    some = ImagePoints(rays.image[rows], rays.point[rows], rays.xy[rows], rays.sigma[rows])
    oriented = oriented_from_adjusted(replace(local, block=replace(block, image_points=some)))
    xy = some.xy if oriented.errors is None else some.xy - oriented.errors
    block = replace(oriented.block, image_points=replace(some, xy=xy))
    return contradictions_in_words(block, marks_of(block, oriented.centre, oriented.rotation).contradictions)
