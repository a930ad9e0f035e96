"""The two epochs of a change: surfaces, what they were measured with, and the cells that both have."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, real_path
from aerotri.crs_text import height_system, heights_of, plan_of, refuse_other_system, same_system, system_in_words
from aerotri.public.models import check_crs
from aerotri.public.places import place_in_words
from aerotri.public.run_steps import DSM, DTM, RESULT
from aerotri.public.saving import RECORD
from aerotri.public.stated import StatedAdjustment
from aerotri.public.volume_sigma import MeasuredSurface

if TYPE_CHECKING:
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.surfaces import SurfaceLike
    from aerotri.rasters.grids import Grid
    from aerotri.terrain.surface import Surface as Heights
    from aerotri.volume.bridges import Bridges
    from aerotri.volume.cell_noise import CellNoise
    from aerotri.volume.change.adjusted import AdjustedPair
    from aerotri.volume.change.compute import BridgedCells, Epoch

Epochs = tuple[MeasuredSurface, MeasuredSurface]
BYTES_OF_CELL = 280
"""Heights, σ, slopes, difference, what volumes are summed from, and how the alignment follows from the cells."""


def epochs_of(
    surfaces: tuple[SurfaceLike, SurfaceLike], adjustments: tuple[Adjustment | FilePath | None, ...]
) -> Epochs:
    """The surfaces with their adjustments as far as they are known.

    Parameters
    ----------
    surfaces : each may be a folder of `run`, which holds both. adjustments : as stated; these count.

    Raises
    ------
    InputError
        For a result without a surface, for one adjustment alone, and for runs of which only one has a dense surface.
    """
    kinds = [_kind_of_run(one) for one in surfaces]
    if {DSM, DTM} <= {kind for kind in kinds if kind}:
        raise InputError(
            "one epoch has a dense surface, the other one only terrain", "give the folders of two of a kind"
        )
    first, second = (
        _epoch_of_run(one, kind, adjustment) if kind else _stated(one, adjustment)
        for one, kind, adjustment in zip(surfaces, kinds, adjustments, strict=True)
    )
    if (first.adjustment is None) != (second.adjustment is None):
        if any(one is not None for one in adjustments):
            raise InputError(
                "the adjustment of one surface is given alone",
                "give both: --first-adjustment and --second-adjustment; one result for both where they share it",
            )
        return MeasuredSurface(first.given), MeasuredSurface(second.given)
    return first, second


def _kind_of_run(given: SurfaceLike) -> str:
    """The folder inside a run that is taken, '' where it is no run."""
    if not isinstance(given, str | os.PathLike):
        return ""
    folder = Path(given)
    if not (folder / RESULT / RECORD).is_file():
        return ""
    for kind in (DSM, DTM):
        if (folder / kind).is_dir():
            return kind
    raise InputError("the run has neither a dense surface nor terrain", "run it with its photographs", folder)


def _epoch_of_run(given: SurfaceLike, kind: str, adjustment: Adjustment | FilePath | None) -> MeasuredSurface:
    folder = Path(os.fspath(given))  # type: ignore[arg-type]
    return MeasuredSurface(folder / kind, StatedAdjustment(folder / RESULT if adjustment is None else adjustment))


def _stated(given: SurfaceLike, adjustment: Adjustment | FilePath | None) -> MeasuredSurface:
    if isinstance(given, str | os.PathLike) and (Path(given) / RECORD).is_file():
        raise InputError(
            "is a result of an adjustment, and has no surface",
            "measure one, `aerotri dsm RESULT PHOTOS`, and give its folder",
            Path(given),
        )
    return MeasuredSurface(given, None if adjustment is None else StatedAdjustment(adjustment))


def pair_of(epochs: Epochs, grid: Grid, heights: tuple[np.ndarray, np.ndarray], crs: str) -> AdjustedPair | None:
    """Both surfaces with their adjustments; None where these are not known.

    Parameters
    ----------
    heights : (rows, columns) m on the cells of `grid`, of either.

    Raises
    ------
    InputError
    """
    from aerotri.volume.change.adjusted import adjusted_pair

    first, second = (one.adjustment for one in epochs)
    if first is None or second is None:
        return None
    for one, stated in zip(epochs, (first, second), strict=True):
        check_crs(stated.record, plan_of(crs), one.surface.path or Path(one.surface.label))
    if not (np.isfinite(heights[0]) & np.isfinite(heights[1])).any():
        message = "the surfaces {} and {} have no cell in common".format(*names_of(epochs))
        raise InputError(message, "check the CRS of both")
    # one result given twice is one adjustment, not two that have all in common
    records = (first.record, first.record if second.is_same(first) else second.record)
    with ExitStack() as stack:
        return adjusted_pair(grid, heights, records, tuple(one.noise(stack).photographs for one in epochs))


def doubts_of(epochs: Epochs) -> list[str]:
    """Sentences on adjustments that are not simply accepted, and on what their σ lacks; each once."""
    stated = [one.adjustment for one in epochs if one.adjustment is not None]
    return list(dict.fromkeys(text for one in stated for text in (one.doubt, one.missing) if text))


def names_of(epochs: Epochs) -> tuple[str, str]:
    """As they stand in results: with as many of the folders above as tell them apart."""
    labels = [one.surface.label for one in epochs]
    paths = [one.surface.path for one in epochs]
    if labels[0] == labels[1] and paths[0] is not None and paths[1] is not None:
        parts = [real_path(path).parts for path in (paths[0], paths[1])]
        for count in range(2, min(map(len, parts)) + 1):
            if parts[0][-count] != parts[1][-count]:
                labels = ["/".join(own[-count:]) for own in parts]
                break
    return labels[0], labels[1]


def common_system(epochs: Epochs) -> tuple[str, str]:
    """The system that both are in, and what the user should know of it.

    Returns
    -------
    'EPSG:n', with '+m' where a system of the heights is stated, '' where neither surface says it; a sentence or ''.

    Raises
    ------
    InputError
        For surfaces in two systems.
    """
    from aerotri.rasters.metric import refuse_stretched

    systems: list[str] = []
    for one in epochs:
        with one.surface.reader() as reader:
            refuse_stretched(reader)
            systems.append(reader.system)
    return system_of_both(systems, names_of(epochs))


def brought_to_metres(epochs: Epochs) -> tuple[Epochs, list[str]]:
    """Both in one system that counts in metres, where files count in degrees or feet; and what was done, in sentences.

    Raises
    ------
    InputError
        For heights in memory that are not in metres.
    """
    from aerotri.rasters.metric import MetricReader, metric_target

    with ExitStack() as stack:
        target = metric_target([stack.enter_context(one.surface.reader()) for one in epochs])
    found: list[MeasuredSurface] = []
    said: list[str] = []
    for one in epochs:
        with one.surface.reader(target) as reader:
            brought, note = isinstance(reader, MetricReader) and reader.is_brought, getattr(reader, "note", "")
        found.append(replace(one, given=replace(one.surface, target=target)) if brought else one)
        said += [note] if note else []
    return (found[0], found[1]), list(dict.fromkeys(said))


def system_of_both(systems: Sequence[str], labels: Sequence[str]) -> tuple[str, str]:
    """As `common_system`, of the systems of two epochs (see `crs_text`) with their names.

    Raises
    ------
    InputError
        For two systems.
    """
    plan, heights = zip(*((plan_of(text), heights_of(text)) for text in systems), strict=True)
    refuse_other_system(plan[1], plan[0], labels[0], labels[1])
    if all(heights) and not same_system(height_system(heights[0]), height_system(heights[1])):
        from aerotri.rasters.height_systems import height_system_in_words

        own, other = (height_system_in_words(code) for code in heights)
        message = f"heights of {labels[1]} are in {other}, of {labels[0]} in {own}"
        raise InputError(message, "bring them into one system of heights")
    system = max(systems, key=lambda text: (bool(text), bool(heights_of(text))))
    return system, silent_in_words(systems, labels)


def silent_in_words(systems: Sequence[str], labels: Sequence[str]) -> str:
    """Which of two surfaces does not state a system that the other one states; '' where both are alike in that.

    Parameters
    ----------
    systems : see `crs_text`. labels : their names.
    """
    for own, other, label in zip(systems, reversed(systems), labels, strict=True):
        if other and not own:
            return f"{label} does not say its coordinate system; taken for {system_in_words(other)}"
        if heights_of(other) and not heights_of(own):
            return f"{label} does not say in which system its heights are"
    return ""


def grid_of(epochs: Epochs) -> Grid:
    """The cells of the coarser surface that lie inside the other one.

    Raises
    ------
    InputError
        When the surfaces do not meet, or do not fit into memory.
    """
    from aerotri.memory import refuse_beyond_memory

    grids = [one.surface.grid for one in epochs]
    own, other = sorted(grids, key=lambda grid: -grid.cell_x * grid.cell_y)
    left, bottom, right, top = other.bounds
    row, last_row = (int(np.clip(np.rint(own.row(y)), 0, own.rows - 1)) for y in (top, bottom))
    column, last_column = (int(np.clip(np.rint(own.column(x)), 0, own.columns - 1)) for x in (left, right))
    apart = left >= own.bounds[2] or right <= own.bounds[0] or bottom >= own.bounds[3] or top <= own.bounds[1]
    rows, columns = last_row - row + 1, last_column - column + 1
    if apart or rows < 3 or columns < 3:
        first, second = names_of(epochs)
        where = [
            f"{name} lies at {place_in_words(grid.bounds)}" for name, grid in zip((first, second), grids, strict=True)
        ]
        raise InputError(f"the surfaces {first} and {second} do not meet: {', '.join(where)}", "check the CRS of both")
    refuse_beyond_memory(
        float(BYTES_OF_CELL) * rows * columns,
        f"a change of {rows} × {columns} cells",
        "cut out the part that is needed",
    )
    return own.window(row, column, rows, columns)


def epoch_of(
    given: MeasuredSurface, grid: Grid, stack: ExitStack, length: float | None, same: bool
) -> tuple[Epoch, str]:
    """A surface on the cells of the change, and what the user should know of its σ."""
    from aerotri.volume.cell_noise import cells_sharing
    from aerotri.volume.change.compute import Epoch

    heights = given.surface.heights
    _refuse_no_sigma(given, heights)
    total = _on(heights, heights.sigma, grid)
    stated = given.noise(stack)
    own, used, said = _own_noise(given, total, grid, stated)
    adjustment = np.zeros_like(total)
    if own is None:
        own = total
        if not np.isfinite(total).any() or length is not None:
            said = ""
    elif not same:
        adjustment = np.sqrt(np.maximum(total**2 - own**2, 0.0))
    used = used if length is None else length
    sharing = cells_sharing(used, grid.cell_x * grid.cell_y)
    bridge = None if stated.bridges is None else _bridged(heights, stated.bridges, grid)
    return Epoch(_on(heights, heights.z, grid), own, adjustment, sharing, stated.lasting, bridge), said


def _bridged(heights: Heights, bridges: Bridges, grid: Grid) -> BridgedCells:
    """What of the cells of a change is bridged below objects."""
    from aerotri.volume.bridges import sigma_of_bridges
    from aerotri.volume.change.compute import BridgedCells

    sigma = sigma_of_bridges(bridges, (0, 0, heights.grid.rows, heights.grid.columns))
    return BridgedCells(np.nan_to_num(_on(heights, sigma, grid)), bridges.patches_at(grid))


def _refuse_no_sigma(given: MeasuredSurface, heights: Heights) -> None:
    """A σ of zero or less is none.

    Raises
    ------
    InputError
    """
    wrong = int(np.count_nonzero(np.isfinite(heights.z) & (heights.sigma <= 0.0)))
    if wrong:
        raise InputError(
            f"{counted(wrong, 'cell')} with a height have a σ of zero or less",
            "give σ as it is, or a raster without a σ band and ground that did not change (--stable)",
            given.surface.path or given.surface.label,
        )


def _own_noise(
    given: MeasuredSurface, total: np.ndarray, grid: Grid, noise: CellNoise
) -> tuple[np.ndarray | None, float, str]:
    """σ of the cells without what the adjustment adds, (rows, columns) m, None where it is not known apart.

    Returns
    -------
    Besides: m, side of the square whose cells have one noise; a sentence where σ is not known apart.
    """
    from aerotri.public.terrain_noise import noise_of_terrain
    from aerotri.volume.bridges import sigma_of_bridges

    heights = given.surface.heights
    if noise.sigma is not None:
        place = (0, 0, heights.grid.rows, heights.grid.columns)
        own = np.hypot(noise.sigma.read(*place).astype(float), sigma_of_bridges(noise.bridges, place))
        return _on(heights, own, grid), noise.length_m, ""
    pickets = noise_of_terrain(given)
    if pickets is not None and np.isfinite(total).any():
        found = pickets.sigma(grid)
        usual = float(np.nanmedian(found)) if np.isfinite(found).any() else 0.0
        # breaklines have no pickets around; no part is larger than the whole
        return np.minimum(np.where(np.isfinite(found), found, usual), total), pickets.interval, ""
    said = (
        f"{given.surface.label}: its σ does not tell noise of the cells from what all cells share; all of it is taken "
        "for noise"
    )
    return None, noise.length_m, said


def _on(heights: Heights, values: np.ndarray, grid: Grid) -> np.ndarray:
    """(rows, columns) of a surface's values, as they are where its cells are the same, else bilinear."""
    from aerotri.terrain.compare import CellHeights, RasterHeights, at_centres

    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    raster = RasterHeights(heights.grid, values)
    # rounding of places would take away the cells at the edge and beside holes
    source = CellHeights(heights.grid, raster) if at_centres(heights.grid, grid) else raster
    return source.at(np.column_stack([x.ravel(), y.ravel()]), "linear").reshape(grid.rows, grid.columns)
