"""Several polygons of one boundary: each measured by itself, and their sum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from aerotri.volume.bases import Base
from aerotri.volume.boundary import Boundary
from aerotri.volume.compute import Volumes
from aerotri.volume.quantity import Volume


@dataclass(frozen=True, eq=False)
class Pile:
    """A polygon with a name, its base and its volumes."""

    name: str
    boundary: Boundary
    base: Base
    volumes: Volumes


def total_of_piles(whole: Volumes, piles: Sequence[Pile]) -> Volumes:
    """The volumes of all polygons together: by every method the sum of those of the piles.

    Parameters
    ----------
    whole : what was computed over all polygons at once: its sections and extremes stay.
    """
    by_method = tuple(
        _sum([one.volumes.by_method[k] for one in piles], first.note) for k, first in enumerate(whole.by_method)
    )
    chosen = by_method[[one.method for one in whole.by_method].index(whole.chosen.method)]
    warnings = dict.fromkeys(f"{one.name}: {text}" for one in piles for text in one.volumes.warnings)
    return replace(whole, chosen=chosen, by_method=by_method, warnings=tuple(warnings))


def _sum(volumes: Sequence[Volume], note: str) -> Volume:
    return Volume(
        volumes[0].method, sum(v.cut for v in volumes), sum(v.fill for v in volumes), sum(v.cut_area for v in volumes),
        sum(v.fill_area for v in volumes), sum(v.no_data_area for v in volumes), note,
    )  # fmt: skip
