"""True orthophotos: every cell from the photograph that sees it best, with seams, colours and accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.crs_text import same_system, system_in_words
from aerotri.execution.choice import THREADS, chosen
from aerotri.execution.opening import opened
from aerotri.public.adjustment import Adjustment
from aerotri.public.argument_types import with_checked_types
from aerotri.public.described import files_in
from aerotri.public.folders import paths_of, refuse_foreign_folder
from aerotri.public.ground_of_block import off_the_ground
from aerotri.public.missing_photographs import missing_in_words, missing_photographs
from aerotri.public.ortho_plots import OrthoPlots
from aerotri.public.progress import ProgressLike, stage_report
from aerotri.public.results import open_result
from aerotri.public.terrain import ENDINGS
from aerotri.public.tile_folder import fingerprints, held_tiles, open_tiles
from aerotri.public.used_arguments import used_settings
from aerotri.public.volume_sigma import MeasuredSurface
from aerotri.results.head import Head
from aerotri.terrain.ortho.settings import DEFAULTS, OrthoSettings, Sampling
from aerotri.volume.settings import LAYERS, Layer

if TYPE_CHECKING:
    from aerotri.public.surfaces import SurfaceLike
    from aerotri.results.adjustment import Adjustment as Record
    from aerotri.terrain.ortho.accuracy import HeightSigma
    from aerotri.terrain.ortho.balance import Balance
    from aerotri.terrain.ortho.make import OrthoOutcome

RECORD, SEAMS, PAGE = "ortho.json", "seams.gpkg", "ortho.html"
PLACE = "folder of ortho"
"""Of the files, as the reference calls it."""
OWN_NAMES = (RECORD, SEAMS, "ortho.tif", "photographs.tif", "sigma.tif", "plots", PAGE)
MOST_NAMED = 5
"""Photographs that a note names."""
LAYER: Layer = "dsm"
"""Of a folder of `aerotri dtm`: with roofs and trees, so that they stand where they are."""


@dataclass(frozen=True, eq=False, repr=False)
class Orthophoto:
    """What `aerotri.orthophoto` wrote.

    Parameters
    ----------
    folder : with ortho.tif and what belongs to it. summary : the content of ortho.json.
    record : the numbers as arrays. points : control and check points in it. notes : on the input
        and on what σ lacks, in sentences.
    """

    folder: Path
    summary: dict[str, Any]
    record: OrthoOutcome
    points: tuple[Any, ...]
    notes: tuple[str, ...] = ()

    @property
    def path(self) -> Path:
        """ortho.tif, a cloud-optimised GeoTIFF; its last band is the mask."""
        return self.folder / "ortho.tif"

    @property
    def plot(self) -> OrthoPlots:
        """Plots of the orthophoto, each a matplotlib Figure."""
        return OrthoPlots(self.record, self.folder, self.points, str(self.summary["block"]))

    def __repr__(self) -> str:
        s = self.summary
        return f"<aerotri orthophoto of {s['block']!r}: {s['columns']} × {s['rows']} cells of {s['cell_m']:g} m>"

    def _repr_html_(self) -> str:
        return self.html()

    def html(self) -> str:
        """Cells and σ, as a notebook shows them."""
        s = self.summary
        return (
            f"<div><b>{escape(str(s['block']))}</b>: {s['columns']} × {s['rows']} cells of {s['cell_m']:g} m, σ of a "
            f"position {s['sigma_m']['total']['median']:.3f} m (median)</div>"
        )


@with_checked_types
def orthophoto(
    result: Adjustment | FilePath,
    photographs: FilePath | Sequence[FilePath],
    surface: SurfaceLike,
    out: FilePath,
    *,
    cell: float | None = DEFAULTS.cell,
    area: tuple[float, float, float, float] | None = DEFAULTS.area,
    edge: float = DEFAULTS.edge,
    resampling: Sampling = DEFAULTS.resampling,
    balance: bool = DEFAULTS.balance,
    seams: bool = DEFAULTS.seams,
    ideal: bool = DEFAULTS.ideal,
    fill: float = DEFAULTS.fill,
    layer: Layer = LAYER,
    plots: bool = True,
    tiles: FilePath | None = None,
    executor: str = THREADS,
    progress: ProgressLike = None,
) -> Orthophoto:
    """Make a true orthophoto: every cell of the ground from the photograph that sees it best.

    Parameters
    ----------
    result : an adjustment, or the folder of one.
    photographs : folder or files of the photographs, TIFF or JPEG.
    surface : heights of the ground with what stands on it, a GeoTIFF in metres, or what `aerotri.terrain` gave.
    out : folder to write; an older result there is replaced in one step.
    cell : m; the size of a pixel on the ground where None.
    area : m, X and Y of the lower left, then of the upper right corner; as far as surface and photographs where None.
    edge : share of the format at its edge that is not used.
    resampling : 'bicubic', 'bilinear' or 'nearest'.
    balance : bring the colours of the photographs to one another.
    seams : lay seams where photographs look alike; without, every cell is from its best photograph.
    ideal : the photographs are those of `aerotri.ideal_photographs`, free of image errors.
    fill : m, holes of the surface that are at most so wide are bridged for the picture; σ is not known there.
    layer : surface of a terrain model: with objects (dsm) or without (dtm).
    plots : draw the plots and the page.
    tiles : folder for the tiles of the orthophoto; a run that was ended goes on with those it finds there. None: they
        are not kept. No other run may write there meanwhile.
    executor : where the tiles are made: 'threads', 'processes:N', 'dask:ADDRESS' or 'dask:local:N'.
    progress : as of `aerotri.adjust`.

    Returns
    -------
    Orthophoto
        Its `path` is the image, its `summary` the content of ortho.json.

    Raises
    ------
    InputError
        For a setting that makes no sense, photographs or a surface that do not fit the block, or a folder with other
        files; and when the executor is none or cannot be reached.
    TasksFailedError
        When an executor could not make tiles; the message names them.

    Examples
    --------
    >>> import aerotri
    >>> found = aerotri.orthophoto("saar_result", "photographs", "saar_dtm", "saar_ortho")  # doctest: +SKIP
    >>> found.summary["sigma_m"]["total"]["median"]  # doctest: +SKIP
    0.041
    """
    settings = OrthoSettings(cell, area, edge, resampling, balance, seams, ideal, fill)
    if layer not in LAYERS:
        raise InputError(f"there is no layer '{layer}'", f"choose one of {', '.join(LAYERS)}")
    kept = None if tiles is None else Path(tiles)
    ground = MeasuredSurface(surface, layer=layer)
    return make_ortho(result, paths_of(photographs), ground, Path(out), settings, plots, kept, progress, executor)


def make_ortho(
    result: Adjustment | FilePath, photographs: Sequence[Path], surface: MeasuredSurface, out: Path,
    settings: OrthoSettings, plots: bool = True, tiles: Path | None = None, progress: ProgressLike = None,
    executor: str = THREADS,
) -> Orthophoto:  # fmt: skip
    """As `orthophoto`, with the settings in one record.

    Raises
    ------
    InputError, TasksFailedError
    """
    settings.check()
    chosen(executor)
    refuse_foreign_folder(out, RECORD)
    with held_tiles(tiles):
        return _made(result, photographs, surface, out, settings, plots, tiles, progress, executor)


def _made(
    result: Adjustment | FilePath, photographs: Sequence[Path], surface: MeasuredSurface, out: Path,
    settings: OrthoSettings, plots: bool, tiles: Path | None, progress: ProgressLike, executor: str,
) -> Orthophoto:  # fmt: skip
    from aerotri.formats.files.atomic import atomic_folder, room_beside
    from aerotri.rasters.grids import cache_limited
    from aerotri.statistics.camera_field import missing_in_sigma
    from aerotri.terrain.dtm import chosen_rows
    from aerotri.terrain.ortho.make import CACHE_BYTES, make_orthophoto

    in_threads = chosen(executor).kind == "threads"
    record = (result if isinstance(result, Adjustment) else open_result(result)).record
    taken = _photographs(record, photographs)
    missing = missing_photographs(record, chosen_rows(record, "all"), taken[0])
    ground = surface.surface
    if tiles is not None:
        open_tiles(tiles, _stated(record, taken[1], ground, settings))
    with ExitStack() as stack, stage_report(progress) as report:
        heights, sigma, notes = _opened(surface, record, stack)
        with cache_limited(CACHE_BYTES):
            far = off_the_ground(heights, record)
        notes += (far,) if far else ()
        folder = stack.enter_context(atomic_folder(out, own=OWN_NAMES))
        workers = None if in_threads else stack.enter_context(opened(executor, report.said))
        room = tiles if in_threads or tiles is not None else stack.enter_context(room_beside(out))
        made = make_orthophoto(record, taken, heights, sigma, settings, folder, report.stage, room, workers)
        lacks = missing_in_sigma(record)
        notes += (*_blurred(made.blur, taken[1]), *_off(made.balance, taken[1]), *((lacks,) if lacks else ()))
        notes += missing_in_words(missing, photographs)
        said = {"photographs_missing": list(missing), "notes": list(notes)}
        head = Head(record.result.block.project, record.result.block.crs)
        outcome, summary, points = _described(record, made, ground.label, settings, folder, head.as_dict(), said)
        if plots:
            report.stage("drawing", None)
            _draw(OrthoPlots(outcome, folder, points, str(record.result.block.name)), summary, folder, head)
    return Orthophoto(out, summary, outcome, points, tuple(summary["notes"]))


def _draw(plots: OrthoPlots, summary: dict[str, Any], folder: Path, head: Head) -> None:
    """Write the plots and the page."""
    from aerotri.report.pages.ortho import ortho_parts
    from aerotri.report.pages.product import write_product_page
    from aerotri.report.plots.rendering import save_plots

    drawn = save_plots(plots.all(), folder / "plots")
    write_product_page(ortho_parts(summary), summary, drawn, files_in(PLACE, folder), folder / PAGE, head)


def _described(
    record: Record, outcome: OrthoOutcome, name: str, settings: OrthoSettings, folder: Path, head: dict[str, Any],
    said: dict[str, Any],
) -> tuple[OrthoOutcome, dict[str, Any], tuple[Any, ...]]:  # fmt: skip
    """Write seams and record beside the image; head, said : what the record begins with, and what else it has."""
    from aerotri.formats.results.adjusted import adjusted_json
    from aerotri.formats.results.json_text import write_json
    from aerotri.formats.results.ortho import marked_points, ortho_json, write_seams
    from aerotri.rasters.grids import horizontal_crs
    from aerotri.report.quality import many_cells

    block = record.result.block
    write_seams(folder / SEAMS, outcome, horizontal_crs(block.crs))
    summary = head | ortho_json(outcome, block, name, settings.resampling)
    large = many_cells("positions", summary["sigma_m"]["total"]["median"], summary["cell_m"])
    summary["settings"] = used_settings(orthophoto, settings, {"cell": "m", "area": "m"})
    summary |= said | {"notes": [*large, *said["notes"]], "adjusted": adjusted_json(record.result)}
    write_json(folder / RECORD, summary)
    return outcome, summary, tuple(marked_points(outcome, block))


def _stated(record: Record, paths: Sequence[Path], surface: Any, settings: OrthoSettings) -> dict[str, Any]:
    """All that tiles depend on."""
    import hashlib

    from aerotri.volume.shared import adjustment_key

    if surface.path is None:
        heights = surface.heights
        held = hashlib.sha256(np.ascontiguousarray(heights.z).tobytes()).hexdigest()
        of_surface: list[Any] = [held, repr(heights.grid)]
    else:
        of_surface = fingerprints([surface.path])
    return {
        "settings": asdict(settings), "adjustment": adjustment_key(record), "surface": of_surface,
        "photographs": fingerprints(paths),
    }  # fmt: skip


def _photographs(record: Record, given: Sequence[Path]) -> tuple[np.ndarray, tuple[Path, ...]]:
    """Oriented photographs of the block, and their files.

    Raises
    ------
    InputError
        When none is found.
    """
    from aerotri.formats.files.photograph_files import match_files, photographs_in
    from aerotri.terrain.dtm import chosen_rows

    missing = [path for path in given if not path.exists()]
    if missing:
        raise InputError("is not there", "give the folder of the photographs, or their files", missing[0])
    files = [f for f in photographs_in(given, ENDINGS) if f.suffix.lower() in ENDINGS]
    found = match_files(files, record.result.block.images.names)
    path_of = {int(row): file for row, file in zip(found, files, strict=True) if row >= 0}
    rows = np.array([r for r in chosen_rows(record, "all") if r in path_of], dtype=np.int64)
    if not len(rows):
        where = ", ".join(str(path) for path in given) or "nothing"
        raise InputError(f"no photograph of the block is in {where}", "give the folder that holds them")
    return rows, tuple(path_of[int(r)] for r in rows)


def _blurred(blur: np.ndarray, paths: Sequence[Path]) -> tuple[str, ...]:
    """A sentence on photographs that show less detail than others."""
    worst = [int(k) for k in np.argsort(-blur, kind="stable") if blur[k] > 1.0]
    if not worst:
        return ()
    named = _named(worst, 1.0 / blur, paths)
    said = "shows" if len(worst) == 1 else "show"
    return (
        f"{counted(len(worst), 'photograph')} {said} less detail than others of the same ground, as blurred ones do: "
        f"{named}; sharper ones are taken where there are any",
    )


def _off(balance: Balance, paths: Sequence[Path]) -> tuple[str, ...]:
    """A sentence on photographs whose colours do not agree with those of others."""
    worst = balance.off.tolist()
    if not worst:
        return ()
    differ = "differs" if len(worst) == 1 else "differ"
    return (
        f"{counted(len(worst), 'photograph')} {differ} in colour from others of the same ground far more than is usual "
        f"in this block: {_named(worst, balance.left, paths)}, in percent of white; look for clouds, their shadows or "
        "a wrong photograph",
    )


def _named(worst: Sequence[int], shares: np.ndarray, paths: Sequence[Path]) -> str:
    """Names with shares of theirs, not too many."""
    more = ", and others" if len(worst) > MOST_NAMED else ""
    return ", ".join(f"{paths[k].name} ({100.0 * shares[k]:.0f} %)" for k in worst[:MOST_NAMED]) + more


def _opened(given: MeasuredSurface, record: Record, stack: ExitStack) -> tuple[Any, HeightSigma, tuple[str, ...]]:
    """Heights, what is known of their errors, and what is to be said about them.

    Raises
    ------
    InputError
        When they are not in metres in the CRS of the block.
    """
    from aerotri.rasters.grids import RasterReader, horizontal_crs
    from aerotri.rasters.held import HeldRaster
    from aerotri.rasters.metric import refuse_other_units
    from aerotri.terrain.ortho.accuracy import HeightSigma
    from aerotri.volume.shared import adjustment_key

    surface, crs = given.surface, horizontal_crs(record.result.block.crs)
    if surface.path is None:
        heights = surface.heights
        sigma = HeldRaster(heights.sigma, heights.grid, surface.crs, surface.label)
        found: Any = surface.reader()
        known = bool(np.isfinite(heights.sigma).any())
    else:
        found = stack.enter_context(RasterReader(surface.path))
        refuse_other_units(found)
        known = found.bands > 1
        sigma = stack.enter_context(RasterReader(surface.path, band=2)) if known else None
    own = found.plan
    if own and (crs is None or not same_system(own, crs)):
        remedy = "give a surface of the same system" if crs is None else f"bring it there: gdalwarp -t_srs {crs} IN OUT"
        raise InputError(f"is in {system_in_words(own)}, the block in {crs or 'local coordinates'}", remedy, found.path)
    notes = []
    if not own and crs is not None:
        notes.append(f"{surface.label} does not say its coordinate system; taken for {crs}")
    if not known:
        notes.append(f"{surface.label} has no σ: the accuracy of the orthophoto is stated without that of the heights")
    same = given.key == adjustment_key(record)
    noise: Any = given.noise(stack).sigma if same and given.layer == LAYER else None
    return found, HeightSigma(sigma if known else None, noise, same), tuple(notes)
