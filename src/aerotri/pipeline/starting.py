"""Where an adjustment starts: given orientations, control and strips, or the tie points alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.doubtful_starts import Orientations
from aerotri.adjustment.prepare import NoStartValuesError
from aerotri.adjustment.rig_start import rig_start_values, without_followers
from aerotri.conventions import FilePath, InputError, counted
from aerotri.coordinates import LocalFrame
from aerotri.coordinates.blocks import frame_of_block, transform_block
from aerotri.functional_model.rotation import angles_from_rotation
from aerotri.observations import Block
from aerotri.observations.rigs import station_places
from aerotri.pipeline.given_starts import checked_start
from aerotri.pipeline.verdict import with_outcome
from aerotri.results.adjustment import Adjustment
from aerotri.results.failure import AdjustmentFailedError
from aerotri.tie_points.measured_start import MeasuredStart, misses, start_from_points

HOLDS, MOST = 4.0, 0.9
"""Median miss of the rays, in tolerances, and share of the photographs with which a start from strips holds."""
POINTS, STRIPS = "points", "strips"
NOT_CONVERGED = "not converged"
ORIENTING = "start values from the tie points"
"""The words for progress."""


@dataclass(frozen=True, eq=False)
class Started:
    """A block with the orientations that its adjustment starts from, and what was done to find them, in sentences.

    lost : of them those about given orientations that do not fit and that nothing replaces.
    """

    block: Block
    messages: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()

    def told(self, found: Adjustment) -> Adjustment:
        """The adjustment with these sentences among its warnings."""
        outcome = found.result.outcome
        return with_outcome(found, replace(outcome, warnings=(*self.messages, *outcome.warnings)))

    def blamed(self, error: AdjustmentFailedError) -> AdjustmentFailedError:
        """The failure of an adjustment from here: what it ran away to tells nothing where the start does not fit."""
        outcome = error.outcome
        if not self.lost or outcome.status != NOT_CONVERGED:
            return error
        message = f"the adjustment began with orientations that do not fit: {'; '.join(self.lost)}"
        return AdjustmentFailedError(replace(outcome, message=message, reasons=(message,)))


def with_start(block: Block, geoid: FilePath | None = None, say: Callable[[str], None] = lambda text: None) -> Started:
    """The block with start values, as its setting `start` says.

    A block with an orientation that is given stays as it is, unless the tie points alone are asked for, or contradict
    it (`given_starts`); one that has been started says start = "auto", so that it is not started again.

    Parameters
    ----------
    geoid : grid of geoid undulations for a CRS that has none of its own.
    say : told when the tie points are tried, which may take a minute.

    Raises
    ------
    NoStartValuesError
        When there are none.
    """
    wanted = block.settings.adjustment.start
    given = np.isfinite(block.images.centre).all(axis=1) & np.isfinite(block.images.angles).all(axis=1)
    if wanted == STRIPS or not len(block.image_points):
        return Started(block)
    frame = None if block.crs == "local" else frame_of_block(block, geoid)
    local = block if frame is None else transform_block(block, frame)
    if wanted != POINTS and given.any():
        return _given_as_far_as_right(block, local, frame, say)
    return _from_measurements(block, local, frame, say)


def _given_as_far_as_right(block: Block, local: Block, frame: LocalFrame | None, say: Callable[[str], None]) -> Started:
    """The block with its given orientations; those that the tie points contradict are replaced by theirs."""

    def begin(bare: Block) -> tuple[Block, tuple[str, ...]]:
        started = _from_measurements(bare, bare, None, say)
        return started.block, started.messages

    checked = checked_start(local, begin)
    if checked is None:
        return Started(block)
    new = checked.replacement.new
    if not new.any():
        return Started(block, checked.messages, checked.lost)
    made = _oriented(block, checked.replacement.orientations.only(new), frame)
    rows, own = new[:, None], block.images
    images = replace(
        own,
        centre=np.where(rows, made.images.centre, own.centre),
        angles=np.where(rows, made.images.angles, own.angles),
    )
    cameras = block.cameras if checked.begun is None else checked.begun.cameras
    return Started(replace(block, images=images, cameras=cameras), checked.messages, checked.lost)


def _from_measurements(block: Block, local: Block, frame: LocalFrame | None, say: Callable[[str], None]) -> Started:
    """The block started without any orientation that is given."""
    if block.settings.adjustment.start == POINTS:
        say(ORIENTING)
        return _from_points(block, local, frame)
    strips = rig_start_values(local)
    quick = Orientations(strips.centre + strips.origin, strips.rotation)
    oriented = np.isfinite(quick.centre[:, 0])
    tied = np.bincount(local.image_points.image, minlength=len(oriented)) > 0
    if oriented.sum() >= MOST * tied.sum() and _median_miss(local, quick) <= HOLDS:
        return Started(_oriented(block, quick, frame))
    say(ORIENTING)
    try:
        found = _from_points(block, local, frame)
    except NoStartValuesError:
        if not oriented.any():
            raise
        return Started(_oriented(block, quick, frame))
    better = np.isfinite(found.block.images.centre[:, 0]).sum() >= oriented.sum()
    return found if better else Started(_oriented(block, quick, frame))


def _median_miss(local: Block, start: Orientations) -> float:
    miss = misses(local, start.centre, start.rotation)
    known = miss[~np.isnan(miss)]
    return float(np.median(known)) if len(known) else np.inf


def _from_points(block: Block, local: Block, frame: LocalFrame | None) -> Started:
    try:
        found = _of_reference_photographs(local) or start_from_points(local)
    except InputError as error:
        raise NoStartValuesError(
            f"no photograph has start values, and the tie points alone give none: {error.message}",
            f"{error.remedy}; or give X0, Y0, Z0, omega, phi, kappa of some photographs in images.csv",
            file="images.csv",
        ) from error
    started = _oriented(block, Orientations(found.centre, found.rotation), frame)
    adjustment = replace(started.settings.adjustment, start="auto")
    settings = replace(started.settings, adjustment=adjustment)
    return Started(replace(started, cameras=found.cameras, settings=settings), found.messages)


def _of_reference_photographs(local: Block) -> MeasuredStart | None:
    """The start of the reference photographs of rigs, which the others follow; None where there is no rig, or where
    they alone do not hold together."""
    places = station_places(local, off_too=True)
    if not places:
        return None
    follow = int((places.mounting >= 0).sum())
    leads = without_followers(local, places)
    try:
        found = start_from_points(leads)
    except InputError:
        return None
    tied = np.bincount(leads.image_points.image, minlength=len(places.lead)) > 0
    if found.oriented.sum() < MOST * tied.sum():
        return None
    told = f"{counted(follow, 'photograph')} of other cameras follow them on their rigs"
    return replace(found, messages=(*found.messages, told))


def _oriented(block: Block, start: Orientations, frame: LocalFrame | None) -> Block:
    """The block with orientations in its CRS; photographs that have none keep the position that is stated."""
    known = np.isfinite(start.centre).all(axis=1)
    found, rotation = start.centre[known], start.rotation[known]
    if frame is not None:
        found = frame.from_local(found)
        rotation = np.swapaxes(frame.axes_at(found), 1, 2) @ rotation
    centre, angles = block.images.centre.copy(), np.full_like(block.images.angles, np.nan)
    centre[known], angles[known] = found, angles_from_rotation(rotation, block.rotation)
    return replace(block, images=replace(block.images, centre=centre, angles=angles))
