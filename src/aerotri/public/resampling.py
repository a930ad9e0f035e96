"""One photograph after the other, or several at once in other processes, resampled without its image errors."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.execution.work import Executor, Report, Work
from aerotri.rasters.photograph_settings import Compression, Resampling

if TYPE_CHECKING:
    from aerotri.image_errors.ideal_map import IdealMap
    from aerotri.image_errors.moving_errors import MovingErrors

BYTES_OF_PHOTOGRAPH = 500_000_000
"""Memory of a process that resamples a photograph, by rows, whatever its size: 0.36 GB were measured."""


@dataclass(frozen=True, eq=False)
class ResampledPhotograph:
    """A photograph to be resampled.

    Parameters
    ----------
    source : its file. name : of the new one in its folder. group : number of its map.
    own : its image errors where it has some of its own (rolling shutter).
    """

    source: Path
    name: str
    group: int
    own: MovingErrors | None


@dataclass(frozen=True, eq=False)
class Resamplings:
    """What all photographs share.

    Parameters
    ----------
    maps : of the groups. folder : to write into. resampling, compression : of the files.
    tell : takes the share of one photograph that is done; not known to other processes.
    """

    maps: dict[int, IdealMap]
    folder: Path
    resampling: Resampling
    compression: Compression
    tell: Callable[[float], None] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return Resamplings, (self.maps, self.folder.absolute(), self.resampling, self.compression)


def resample_photograph(shared: Resamplings, one: ResampledPhotograph) -> tuple[tuple[str, ...], float]:
    """Write one ideal photograph, whole or not at all; what of it could not be carried over, and the seconds.

    Raises
    ------
    InputError
    """
    from aerotri.formats.files.atomic import atomic_file
    from aerotri.image_errors.ideal_map import ideal_map
    from aerotri.image_errors.ideal_photographs import ideal_photograph

    started, target = time.perf_counter(), shared.folder / one.name
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(target) as place:
        mapped = shared.maps[one.group] if one.own is None else ideal_map(one.own)
        lost = ideal_photograph(one.source, place, mapped, shared.resampling, shared.compression, shared.tell)
    return lost, round(time.perf_counter() - started, 3)


def resample_photographs(
    shared: Resamplings, photographs: Sequence[ResampledPhotograph], executor: Executor, room: Path,
    report: Report,
) -> list[tuple[tuple[str, ...], float]]:  # fmt: skip
    """Write all of them; of each what could not be carried over, and the seconds.

    Parameters
    ----------
    room : folder for what photographs share.

    Raises
    ------
    InputError, TasksFailedError
    """
    names = [f"photograph {one.source.name}" for one in photographs]
    # in threads one after the other: each is resampled by all threads
    work = Work(
        resample_photograph, shared, photographs, names, "photographs", room, BYTES_OF_PHOTOGRAPH,
        "run the command again", at_once=1,
    )  # fmt: skip
    return executor.run(work, report)
