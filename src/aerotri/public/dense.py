"""The whole surface by dense matching, with a σ for every cell."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.execution.choice import THREADS, chosen
from aerotri.public.adjustment import Adjustment
from aerotri.public.argument_types import with_checked_types
from aerotri.public.dense_plots import DensePlots
from aerotri.public.described import files_in
from aerotri.public.folders import paths_of, refuse_foreign_folder
from aerotri.public.missing_photographs import missing_in_words, missing_photographs
from aerotri.public.progress import ProgressLike, stage_report
from aerotri.public.results import open_result
from aerotri.public.surfaces import Surface
from aerotri.public.terrain import rows_and_files
from aerotri.public.tile_folder import fingerprints, held_tiles, open_tiles
from aerotri.public.used_arguments import used_settings
from aerotri.results.head import Head
from aerotri.terrain.settings import DENSE_DEFAULTS, DenseSettings

if TYPE_CHECKING:
    from aerotri.formats.files.spool import Spool
    from aerotri.terrain.dense.bare_ground import BareGround
    from aerotri.terrain.dense.measure import DenseOutcome

RECORD, SURFACE, MATCHING, COUNT, CLOUD = "dsm.json", "dsm.tif", "matching.tif", "photographs.tif", "dsm.laz"
GROUND, SOURCE, PAGE = "dtm.tif", "ground.tif", "dsm.html"
PLACE = "folder of dsm"
"""Of the files, as the reference calls it."""
OWN_NAMES = (RECORD, SURFACE, MATCHING, COUNT, CLOUD, GROUND, SOURCE, "plots", PAGE)


@dataclass(frozen=True, eq=False, repr=False)
class DenseSurface:
    """What `aerotri.dense_surface` measured: a height and its σ for every cell that could be matched.

    Parameters
    ----------
    record : the numbers, in tiles. block : name of the block. crs : its coordinate system.
    adjustment : key of the adjustment it was measured with.
    ground : the ground without objects, None where it was not asked for.
    keeper : what removes the tiles when nobody uses them any more; None where they stay.
    head : of files. settings : every argument that was used, as dsm.json has them.
    missing : photographs of the block that were not given.
    of_input : notes on the input and on what σ lacks, in sentences.
    adjusted : verdict and check points of the adjustment, as dsm.json has them.
    """

    record: DenseOutcome
    block: str
    crs: str
    adjustment: str
    ground: BareGround | None = None
    keeper: Spool | None = None
    head: Head = field(default_factory=Head)
    settings: list[dict[str, Any]] = field(default_factory=list)
    missing: tuple[str, ...] = ()
    of_input: tuple[str, ...] = ()
    adjusted: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def surface(self) -> Surface:
        """The heights and their σ, as `aerotri.compare` and `aerotri.volume` take them, held in memory."""
        from aerotri.rasters.grids import crs_of_heights
        from aerotri.terrain.surface import Surface as Heights

        grid = self.record.grid
        z, sigma = np.full((grid.rows, grid.columns), np.nan), np.full((grid.rows, grid.columns), np.nan)
        for row, column, heights, total in _surface_parts(self.record):
            place = np.s_[row : row + heights.shape[0], column : column + heights.shape[1]]
            z[place], sigma[place] = heights, total
        return Surface(Heights(grid, z, sigma), crs_of_heights(self.crs), SURFACE)

    @cached_property
    def dtm(self) -> Surface:
        """The ground without objects and its σ, as `surface` has the whole, held in memory.

        Raises
        ------
        InputError
            When the surface was measured without ground=True.
        """
        from aerotri.rasters.grids import crs_of_heights
        from aerotri.terrain.surface import Surface as Heights

        if self.ground is None:
            raise InputError("the ground was not filtered", "measure the surface with ground=True")
        grid = self.record.grid
        z, sigma = np.full((grid.rows, grid.columns), np.nan), np.full((grid.rows, grid.columns), np.nan)
        for row, column, heights, total in _ground_parts(self.record, self.ground):
            place = np.s_[row : row + heights.shape[0], column : column + heights.shape[1]]
            z[place], sigma[place] = heights, total
        return Surface(Heights(grid, z, sigma), crs_of_heights(self.crs), GROUND)

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The content of dsm.json: cells, σ and its parts."""
        return self.head.as_dict() | self._numbers | {
            "photographs_missing": list(self.missing), "adjustment": self.adjustment, "settings": self.settings,
            "notes": list(self.notes), "adjusted": self.adjusted,
        }  # fmt: skip

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What is to be known of it, in sentences: a large σ first, then notes on the input."""
        from aerotri.report.quality import many_cells

        return (*many_cells("heights", self._numbers["sigma_Z_m"]["median"], self._numbers["cell_m"]), *self.of_input)

    @cached_property
    def _numbers(self) -> dict[str, Any]:
        from aerotri.formats.results.dense import dense_json

        return dense_json(self.record, self.block, self.crs, self.ground)

    @property
    def plot(self) -> DensePlots:
        """Plots of the surface, each a matplotlib Figure."""
        return DensePlots(self.record, self.block, self.summary["sigma_Z_m"])

    def save(self, out: FilePath, plots: bool = True) -> Path:
        """Write dsm.tif, matching.tif, photographs.tif, dsm.laz, dsm.json, the plots and the page into a folder.

        Where the ground was filtered, dtm.tif and ground.tif besides.

        Parameters
        ----------
        out : folder; an older result there is replaced in one step. plots : draw the plots and the page.

        Returns
        -------
        Path of the folder.

        Raises
        ------
        InputError
            When the folder holds other files, or cannot be written to.
        """
        target = Path(out)
        refuse_foreign_folder(target, RECORD)
        _write(target, self, plots)
        return target

    def __repr__(self) -> str:
        s = self.summary
        return f"<aerotri dense surface of {self.block!r}: {s['cells']['measured']} cells of {s['cell_m']:g} m>"

    def _repr_html_(self) -> str:
        return self.html()

    def html(self) -> str:
        """Cells and σ, as a notebook shows them."""
        s = self.summary
        sigma = s["sigma_Z_m"]
        return (
            f"<div><b>{escape(self.block)}</b>: {s['cells']['measured']} cells of {s['cell_m']:g} m, σ of Z "
            f"{sigma['median']:.3f} m (median; matching {sigma['matching']:.3f}, adjustment "
            f"{sigma['adjustment']:.3f})</div>"
        )


@with_checked_types
def dense_surface(
    result: Adjustment | FilePath,
    photographs: FilePath | Sequence[FilePath],
    *,
    resolution: float | None = DENSE_DEFAULTS.resolution,
    area: tuple[float, float, float, float] | None = DENSE_DEFAULTS.area,
    most_pairs: int = DENSE_DEFAULTS.most_pairs,
    edge: float = DENSE_DEFAULTS.edge,
    ideal: bool = DENSE_DEFAULTS.ideal,
    ground: bool = DENSE_DEFAULTS.ground,
    widest_object: float = DENSE_DEFAULTS.widest_object,
    tiles: FilePath | None = None,
    executor: str = THREADS,
    progress: ProgressLike = None,
) -> DenseSurface:
    """Match the photographs densely: a height with its σ for every cell of a raster.

    Parameters
    ----------
    result : an adjustment, or the folder of one.
    photographs : folder or files of the photographs, TIFF or JPEG.
    resolution : m, cell of the surface; two pixels on the ground where None.
    area : m, X and Y of the lower left, then of the upper right corner; as far as photographs reach where None.
    most_pairs : pairs of photographs that measure a piece of ground, at most; up to 8 where there are holes.
    edge : share of the format at its edge that is not used.
    ideal : the photographs are those of `aerotri.ideal_photographs`, free of image errors.
    ground : filter the ground besides, without objects.
    widest_object : m, the widest object that is taken off it.
    tiles : folder for the tiles of the surface; a run that was ended goes on with those it finds there. None: a
        temporary one. Workers on other machines have to see it. No other run may write there meanwhile.
    executor : where the tiles are measured: 'threads', 'processes:N', 'dask:ADDRESS' or 'dask:local:N'.
    progress : as of `aerotri.adjust`.

    Returns
    -------
    DenseSurface
        Its `surface` has heights and σ, its `dtm` those of the ground.

    Raises
    ------
    InputError
        For a setting that makes no sense, photographs that are not found, or where nothing could be matched.
    TasksFailedError
        When tiles could not be measured; it names them.

    Examples
    --------
    >>> import aerotri
    >>> dense = aerotri.dense_surface("saar_result", "photographs")  # doctest: +SKIP
    >>> dense.save("saar_dsm")  # doctest: +SKIP
    """
    return measure_dense(result, paths_of(photographs), DenseSettings(resolution, area, most_pairs, edge, ideal, ground,
                                                                         widest_object),
                         None if tiles is None else Path(tiles), progress, executor)  # fmt: skip


def measure_dense(
    result: Adjustment | FilePath, photographs: Sequence[Path], settings: DenseSettings, tiles: Path | None,
    progress: ProgressLike = None, executor: str = THREADS,
) -> DenseSurface:  # fmt: skip
    """As `dense_surface`, with the settings in one record.

    Raises
    ------
    InputError, TasksFailedError
    """
    settings.check()
    chosen(executor)
    with held_tiles(tiles):
        return _measured(result, photographs, settings, tiles, progress, executor)


def _measured(
    result: Adjustment | FilePath, photographs: Sequence[Path], settings: DenseSettings, tiles: Path | None,
    progress: ProgressLike, executor: str,
) -> DenseSurface:  # fmt: skip
    from aerotri.execution.opening import opened
    from aerotri.formats.files.spool import Spool
    from aerotri.formats.results.adjusted import adjusted_json
    from aerotri.statistics.camera_field import missing_in_sigma
    from aerotri.terrain.dense.bare_ground import bare_ground
    from aerotri.terrain.dense.measure import DensePlan, measure_surface
    from aerotri.terrain.dtm import chosen_rows
    from aerotri.terrain.pickets import Area
    from aerotri.volume.shared import adjustment_key

    record = (result if isinstance(result, Adjustment) else open_result(result)).record
    wanted = chosen_rows(record, "all")
    rows, paths = rows_and_files(record, photographs, wanted)
    missing = missing_photographs(record, wanted, rows)
    key = adjustment_key(record)
    keeper = None
    if tiles is None:
        keeper = Spool()
        tiles = keeper.folder
    else:
        of_tiles = {name: value for name, value in asdict(settings).items() if name not in ("ground", "widest_object")}
        open_tiles(tiles, {"settings": of_tiles, "adjustment": key, "photographs": fingerprints(paths)})
    area = None if settings.area is None else Area(np.array(settings.area[:2]), np.array(settings.area[2:]))
    plan = DensePlan(rows, paths, tiles, settings.resolution, area, settings.most_pairs, settings.edge, settings.ideal)
    with stage_report(progress) as report, opened(executor, report.said) as workers:
        outcome = measure_surface(record, plan, report.stage, workers)
    ground = bare_ground(outcome, settings.widest_object) if settings.ground else None
    block = record.result.block
    used = used_settings(dense_surface, settings, {"resolution": "m", "area": "m", "widest_object": "m"})
    lacks = missing_in_sigma(record)
    notes = (*missing_in_words(missing, photographs), *((lacks,) if lacks else ()))
    head = Head(block.project, block.crs)
    return DenseSurface(
        outcome, str(block.name), block.crs, key, ground, keeper, head, used, missing, notes,
        adjusted_json(record.result),
    )  # fmt: skip


def _surface_parts(o: DenseOutcome) -> Iterator[tuple[int, int, np.ndarray, np.ndarray]]:
    """First row and column, heights and their σ, of every tile."""
    for window, tile in o.files.read_all(list(o.windows)):
        grid = o.grid.window(window.row, window.column, window.rows, window.columns)
        yield window.row, window.column, tile.z, np.hypot(tile.sigma, o.shared.over(grid))


def _ground_parts(o: DenseOutcome, ground: BareGround) -> Iterator[tuple[int, int, np.ndarray, np.ndarray]]:
    """First row and column, heights of the ground and their σ, of every tile."""
    for window, tile in ground.tiles():
        grid = o.grid.window(window.row, window.column, window.rows, window.columns)
        yield window.row, window.column, tile.z, np.hypot(tile.sigma, o.shared.over(grid))


def _write(target: Path, dense: DenseSurface, plots: bool) -> None:
    """Write all files whole or not at all."""
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.formats.results.copc import octree_over
    from aerotri.formats.results.json_text import write_json
    from aerotri.formats.results.point_cloud import write_surface_cloud
    from aerotri.rasters.grids import crs_of_heights, horizontal_crs
    from aerotri.rasters.surface_files import write_raster_parts, write_surface_parts
    from aerotri.terrain.dense.points import surface_points

    o, crs = dense.record, horizontal_crs(dense.crs)
    of_heights, noise = crs_of_heights(dense.crs), dense.summary["noise_length_m"]
    tags = {} if noise is None else {"NOISE_LENGTH_M": f"{noise:.4g}"}
    lasting = dense.summary["matching_shared"]
    tags |= {"SHARED_SIGMA_M": f"{lasting['sigma_Z_m']:.4g}", "SHARED_LENGTH_M": f"{lasting['length_m']:.4g}"}
    windows = list(o.windows)
    with atomic_folder(target, own=OWN_NAMES) as folder:
        write_surface_parts(folder / SURFACE, _surface_parts(o), o.grid, of_heights, "DSM Z, m", tags)
        matching = ((w.row, w.column, tile.sigma) for w, tile in o.files.read_all(windows))
        what = "σ of Z of matching alone, m"
        write_raster_parts(folder / MATCHING, matching, o.grid, crs, what, np.dtype(np.float32), -9999.0)
        count = ((w.row, w.column, tile.count) for w, tile in o.files.read_all(windows))
        what = "photographs that measured a cell"
        write_raster_parts(folder / COUNT, count, o.grid, crs, what, np.dtype(np.uint8), 0.0)
        heights = [(np.nanmin(t.z), np.nanmax(t.z)) for _, t in o.files.read_all(windows) if np.isfinite(t.z).any()]
        left, bottom, right, top = o.grid.bounds
        low, high = np.array([left, bottom, np.min(heights)]), np.array([right, top, np.max(heights)])
        tree = octree_over(low, high, o.grid.cell_x)
        write_surface_cloud(folder / CLOUD, surface_points(o, dense.ground), tree, of_heights)
        if dense.ground is not None:
            write_surface_parts(folder / GROUND, _ground_parts(o, dense.ground), o.grid, of_heights, "DTM Z, m", tags)
            source = ((w.row, w.column, tile.source) for w, tile in dense.ground.tiles())
            what = "ground: 1 measured, 2 bridged"
            write_raster_parts(folder / SOURCE, source, o.grid, crs, what, np.dtype(np.uint8), 0.0)
        if plots:
            from aerotri.report.pages.dense import dense_parts
            from aerotri.report.pages.product import write_product_page
            from aerotri.report.plots.rendering import save_plots

            drawn, said = save_plots(dense.plot.all(), folder / "plots"), dense.summary
            write_product_page(dense_parts(said), said, drawn, files_in(PLACE, folder), folder / PAGE, dense.head)
        write_json(folder / RECORD, dense.summary)
