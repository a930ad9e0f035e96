"""Given start orientations that the tie points contradict: determined anew from these, and named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.directions import directions_of
from aerotri.adjustment.doubtful_starts import (
    MISSES,
    Orientations,
    Replacement,
    accepted,
    doubtful,
    given_orientations,
    miss_by_photograph,
    misses_of_control,
    oriented_anew,
)
from aerotri.adjustment.prepare import NoStartValuesError
from aerotri.diagnosis.angle_conventions import Convention, convention_between
from aerotri.diagnosis.group_names import photographs_in_words
from aerotri.functional_model.rotation import angles_from_rotation
from aerotri.observations import Block

MOST_WRONG = 0.5
"""Share of the photographs up to which single ones are wrong; of more the start as a whole is sought anew."""
MOST = 0.9
"""Share of the photographs that a new start of the whole block has to bring to fit."""
LOOKS_DOWN = 0.3
"""Vertical component of the mean axis of the cameras, against the view, from which a block looks down."""
FEWEST_CONTROL = 3
"""Rays to control points from which these tell whether a new start can be right."""


Begin = Callable[[Block], tuple[Block, tuple[str, ...]]]
"""Starts a block without angles; the block with orientations, and how."""


@dataclass(frozen=True, eq=False)
class CheckedStart:
    """What takes the place of given orientations, and the sentences about it.

    lost : of the sentences those about orientations that nothing replaces.
    begun : the block as it was started without its angles, where all of it was.
    """

    replacement: Replacement
    messages: tuple[str, ...]
    lost: tuple[str, ...] = ()
    begun: Block | None = None


def checked_start(local: Block, begin: Begin) -> CheckedStart | None:
    """What takes the place of given orientations that the tie points contradict; None where they contradict none.

    Parameters
    ----------
    local : the block in a local frame.
    """
    given = given_orientations(local)
    wrong = doubtful(local, given)
    if not wrong.any():
        return None
    if wrong.sum() <= MOST_WRONG * given.known.sum():
        made = oriented_anew(local, given, wrong)
        lost = _lost(local, made)
        return CheckedStart(made, _replaced(local, given, made) + lost, lost)
    nothing = Replacement(given, np.zeros_like(wrong), wrong)
    lost = _lost(local, nothing)
    return _all_anew(local, given, begin) or CheckedStart(nothing, lost, lost)


def _all_anew(local: Block, given: Orientations, begin: Begin) -> CheckedStart | None:
    """The block started without its angles; None where that does not lead to where its positions and control are."""
    nothing = np.full_like(local.images.angles, np.nan)
    try:
        begun, messages = begin(replace(local, images=replace(local.images, angles=nothing)))
    except NoStartValuesError:
        return None
    made = accepted(local, given, given_orientations(begun), given.known)
    if made.new.sum() < MOST * given.known.sum() or not _is_plausible(local, given, made.orientations):
        return None
    return CheckedStart(made, (*_replaced(local, given, made), *messages), (), begun)


def _is_plausible(local: Block, given: Orientations, found: Orientations) -> bool:
    """Whether a block sees its control points where they are, and did not turn to look up."""
    missed = misses_of_control(local, found)
    if len(missed) >= FEWEST_CONTROL:
        return bool(np.median(missed) < MISSES)
    up, was_up = (-np.nanmean(way.rotation[:, 2, 2]) for way in (found, given))
    return bool(up < LOOKS_DOWN or was_up > LOOKS_DOWN)


def _replaced(local: Block, given: Orientations, made: Replacement) -> tuple[str, ...]:
    """Start angles that were not used, one sentence for photographs that are off alike."""
    said, turned = [], np.degrees(given.turned_to(made.orientations))
    for convention, rows in _alike(local, made):
        off = f"{turned[rows[0]]:.0f}°" if len(rows) == 1 else f"{np.median(turned[rows]):.0f}° (median)"
        agree = "" if convention is None else f"; with {convention.remedy} they agree"
        said.append(
            f"start angles of {photographs_in_words(local, rows)} were not used: they are {off} off those of the "
            f"tie points, which were used instead{agree}"
        )
    return tuple(said)


def _alike(local: Block, made: Replacement) -> list[tuple[Convention | None, np.ndarray]]:
    """Photographs with new orientations by the convention that explains the given angles; None where none does."""
    rows = np.flatnonzero(made.new)
    given, order = local.images.angles, local.rotation
    found = np.full_like(given, np.nan)
    found[rows] = angles_from_rotation(made.orientations.rotation[rows], order)
    strip, groups = np.asarray(local.images.strip), []
    together = convention_between(given[rows], found[rows], order) if len(rows) > 1 else None
    for name in () if together else np.unique(strip[rows]):
        own = rows[strip[rows] == name]
        convention = convention_between(given[own], found[own], order) if len(own) > 1 else None
        if convention is not None:
            groups.append((convention, own))
            rows = np.setdiff1d(rows, own)
    return groups + ([(together, rows)] if len(rows) else [])


def _lost(local: Block, made: Replacement) -> tuple[str, ...]:
    """Photographs whose start fits the tie points neither as given nor otherwise."""
    if not made.lost.any():
        return ()
    missed = miss_by_photograph(local, directions_of(local), made.orientations)[made.lost]
    names = photographs_in_words(local, np.flatnonzero(made.lost))
    return (
        f"start orientation of {names}: image points miss the others by {np.degrees(np.nanmedian(missed)):.0f}° "
        "(median), and no orientation was found that fits: check image points, names of points, positions, angles and "
        "the principal distance",
    )
