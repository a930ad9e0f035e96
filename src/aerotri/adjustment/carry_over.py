"""From one adjustment to another one of the same block with other observations: where it stood, unknown by unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.unknowns import StartValues, State, Unknowns


def start_values_at(unknowns: Unknowns, state: State) -> StartValues:
    """The state of an adjustment as start values of another one of the same block."""
    n, count = len(unknowns.block.images), len(unknowns.block.points)
    rotation, centre, points = np.full((n, 3, 3), np.nan), np.full((n, 3), np.nan), np.full((count, 3), np.nan)
    rotation[unknowns.images], centre[unknowns.images] = state.rotation, state.centre
    points[unknowns.points] = state.points
    at = unknowns.block.image_points.xy.copy()
    at[unknowns.rays.source] = unknowns.rays.at
    return StartValues(unknowns.origin, rotation, centre, points, at)


def with_shared(new: Unknowns, old: Unknowns, start: State, state: State) -> State:
    """The start with the shared parameters where they stood, by name and group."""
    at = {key: k for k, key in enumerate(zip(old.shared.names, old.shared.groups, strict=True))}
    values = start.shared.copy()
    for k, key in enumerate(zip(new.shared.names, new.shared.groups, strict=True)):
        if key in at:
            values[k] = state.shared[at[key]]
    return new.with_followers(replace(start, shared=values))


def reference_state(new: Unknowns, old: Unknowns, start: State, original: State) -> State:
    """The start with the points where they were before any adjustment: what a free block's datum refers to."""
    row = np.full(len(old.block.points), -1)
    row[old.points] = np.arange(len(old.points))
    return replace(start, points=original.points[row[new.points]])
