"""A surface against a control surface: differences cell by cell, and what follows from them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.crs_text import height_system, heights_of, plan_of, refuse_other_system, same_system
from aerotri.public.argument_types import with_checked_types
from aerotri.public.change_epochs import silent_in_words
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.progress import ProgressLike, stage_report
from aerotri.public.projects import project_of
from aerotri.public.surfaces import Surface, as_surface
from aerotri.public.table import Table
from aerotri.public.used_arguments import used_arguments
from aerotri.results.head import Head
from aerotri.terrain.settings import ALIGNMENT, ALIGNMENTS, INTERPOLATION, INTERPOLATIONS, Interpolation, Movement

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.formats.files.heights import HeightSource
    from aerotri.public.surfaces import SurfaceLike
    from aerotri.rasters.grids import Grid
    from aerotri.terrain.compare import Comparison
    from aerotri.volume.lasting import Lasting

RECORD = "compare.json"
DIFFERENCE = "difference.tif"
OWN_NAMES = (RECORD, DIFFERENCE, "plots")
GROSS = 4.0
"""NMAD from the median beyond which a difference does not tell the noise; chosen [C]: normal noise has none there."""


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceComparison:
    """What `aerotri.compare` returns: differences test − control, m.

    Parameters
    ----------
    record : the differences as an array, with their statistics.
    test, control : names of the surfaces. method : how both were interpolated.
    crs : 'EPSG:n', None where not known.
    notes : what was done to bring the surfaces to metres, in sentences.
    head : of files. settings : every argument that was used, as compare.json has them.
    lasting : of test and control, errors of dense matching that do not average out.
    """

    record: Comparison
    test: str
    control: str
    method: str
    crs: str | None = None
    notes: tuple[str, ...] = ()
    head: Head = field(default_factory=Head)
    settings: list[dict[str, Any]] = field(default_factory=list)
    lasting: tuple[Lasting, ...] = ()

    @property
    def rmse(self) -> float:
        """m, root of the mean square of all differences."""
        return self.record.statistics.rmse

    @property
    def bias(self) -> float:
        """m, mean of the differences."""
        return self.record.statistics.bias

    @cached_property
    def noise_length(self) -> float | None:
        """m, side of the square whose cells share one noise, from the differences; None where too few tell."""
        from aerotri.volume.change.noise import cells_of_one_noise

        d, s, grid = self.record.difference, self.record.statistics, self.record.grid
        usual = np.abs(d - s.median) <= GROSS * max(s.nmad, 1e-12)
        cells = cells_of_one_noise(np.where(usual, d - np.mean(d[usual]), np.nan)) if usual.any() else 0.0
        return float(np.sqrt(cells * grid.cell_x * grid.cell_y)) if cells > 0.0 else None

    @property
    def bias_sigma(self) -> float | None:
        """m, σ of the mean difference; None where not known.

        As its cells scatter, those of one noise once, and what errors that do not average out add.
        """
        if self.noise_length is None:
            return None
        s, grid = self.record.statistics, self.record.grid
        independent = max(s.count * grid.cell_x * grid.cell_y / self.noise_length**2, 1.0)
        return float(np.hypot(s.std / np.sqrt(independent), self.matching_shared))

    @cached_property
    def matching_shared(self) -> float:
        """m, σ of the mean difference by errors that neighbouring cells of dense surfaces share.

        0 for other surfaces, and where one was moved onto the other: a shift takes the mean with it.
        """
        from aerotri.volume.lasting import lasting_variance_of_cells

        if self.record.alignment is not None:
            return 0.0
        grid, known = self.record.grid, np.isfinite(self.record.difference)
        weight, cell = known / max(int(known.sum()), 1), (grid.cell_x, grid.cell_y)
        return float(np.sqrt(sum(lasting_variance_of_cells(weight, cell, one) for one in self.lasting)))

    @property
    def nmad(self) -> float:
        """m, 1.4826 times the median of |difference − median|: the σ of a distribution with gross errors."""
        return self.record.statistics.nmad

    @property
    def coverage(self) -> float:
        """Share of the control surface that the test surface covers, 0 … 1."""
        return self.record.coverage

    @cached_property
    def statistics(self) -> Table:
        """Count, RMSE, bias, median, standard deviation, NMAD, LE90 and largest difference, m, in one row."""
        import pyarrow as pa

        values = asdict(self.record.statistics)
        columns = {name: [value] for name, value in values.items()}
        return Table("differences", pa.table(columns), {name: "m" for name in values if name != "count"})

    @cached_property
    def difference(self) -> Surface:
        """The differences, m, as a surface; NaN where either has none."""
        from aerotri.terrain.surface import Surface as Heights

        d = self.record.difference
        return Surface(Heights(self.record.grid, d, np.full_like(d, np.nan)), self.crs, "difference.tif")

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The content of compare.json."""
        from aerotri.formats.results.terrain import comparison_json

        sure = {
            "sigma_bias_m": self.bias_sigma, "matching_shared_m": self.matching_shared,
            "noise_length_m": self.noise_length,
        }  # fmt: skip
        found = comparison_json(self.record, self.test, self.control, self.method)
        return self.head.as_dict() | found | sure | {"settings": self.settings}

    def plot(self) -> Figure:
        """The differences as a map and as a histogram."""
        from aerotri.report.plots.terrain import plot_comparison

        return plot_comparison(self.record, f"{self.test} − {self.control}")

    def save(self, out: FilePath, plots: bool = True) -> Path:
        """Write compare.json, the raster of the differences and the plot into a folder.

        Parameters
        ----------
        out : folder; an older comparison there is replaced in one step. plots : draw map and histogram.

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
        return f"<aerotri comparison {self.test!r} − {self.control!r}: RMSE {self.rmse:.3g} m, NMAD {self.nmad:.3g} m>"

    def _repr_html_(self) -> str:
        moved = f"<p>{escape(self.record.alignment_text)}</p>" if self.record.alignment_text else ""
        return (
            f"<div><b>{escape(self.test)} − {escape(self.control)}</b>, {100.0 * self.coverage:.1f} % of the control "
            f"covered{moved}{self.statistics.html()}</div>"
        )


@with_checked_types
def compare(
    test: SurfaceLike,
    control: SurfaceLike,
    *,
    method: Interpolation = INTERPOLATION,
    align: Movement = ALIGNMENT,
    cell: float | None = None,
    project: FilePath | None = None,
    progress: ProgressLike = None,
) -> SurfaceComparison:
    """Differences of two surfaces, both interpolated to the same places in the same way.

    Rasters with the same cells are compared cell by cell, and nothing is interpolated.

    Parameters
    ----------
    test : surface to judge: GeoTIFF, LAZ, pickets.parquet, folder of `aerotri dtm`, or a surface in memory.
    control : surface of the same kinds that it is held against.
    method : interpolation of both.
    align : move the first onto the second before: not at all, by a shift in X, Y, Z, or turned as well.
    cell : m, of the differences; the larger one of both where None.
    project : block, or result of an adjustment, whose [project] stands at the head of the file; that of the surfaces
        where None.
    progress : as of `aerotri.adjust`.

    Returns
    -------
    SurfaceComparison

    Raises
    ------
    InputError
        When a file cannot be read, or the surfaces have no place in common.

    Examples
    --------
    >>> import aerotri, numpy as np
    >>> x = np.linspace(0.0, 3.0, 50)
    >>> hills = aerotri.Surface.of_array(np.sin(x)[:, None] + np.cos(x), left=0.0, top=100.0, cell=2.0)
    >>> higher = aerotri.Surface.of_array(hills.z + 0.25, left=0.0, top=100.0, cell=2.0)
    >>> found = aerotri.compare(higher, hills)
    >>> round(found.bias, 3), round(found.nmad, 3)
    (0.25, 0.0)
    """
    from aerotri.rasters.grids import cache_limited
    from aerotri.terrain.compare import common_grid, same_cells
    from aerotri.terrain.compare import compare as differences

    _check(method, align)
    with stage_report(progress) as report, ExitStack() as stack:
        report.stage("reading", None)
        stack.enter_context(cache_limited())
        one, other = _sources(test, control, stack)
        refuse_other_system(one.plan, other.plan, "the control", _file(test) or _name(test))
        same = same_cells(one.heights, other.heights, (one.area, other.area), cell)
        grid = same or common_grid(one.area, other.area, cell or max(one.cell, other.cell))
        report.stage("comparing", None)
        found = differences(
            one.heights, other.heights, grid, method, align, lambda k, n: report.counted("comparing", k, n)
        )
    notes = tuple(source.note for source in (one, other) if source.note) + _systems_in_words(
        (one, other), (test, control)
    )
    if same is not None and align == "none":
        notes += (_of_cells(same, one, method),)
    crs = one.plan or other.plan or None
    head = Head(project_of(project, test, control), max(one.crs, other.crs, key=len))
    used = used_arguments(compare, {"method": method, "align": align, "cell": cell}, {"cell": "m"})
    lasting = tuple(map(_lasting_of, (test, control)))
    return SurfaceComparison(found, _name(test), _name(control), method, crs, notes, head, used, lasting)


def _check(method: str, align: str) -> None:
    for name, value, known in (("method", method, INTERPOLATIONS), ("alignment", align, ALIGNMENTS)):
        if value not in known:
            raise InputError(f"there is no {name} '{value}'", f"choose one of {', '.join(known)}")


def _of_cells(grid: Grid, source: HeightSource, method: str) -> str:
    """That nothing was interpolated, and which of the cells were compared."""
    from aerotri.terrain.compare import MOST_CELLS

    every = round(grid.cell_x / source.cell)
    some = "" if every <= 1 else f", every {every} rows and columns one, so that no side has more than {MOST_CELLS}"
    unused = "" if method == INTERPOLATION else f" (method '{method}' is not used)"
    return f"both surfaces have the same cells, which are compared as they are{unused}{some}"


def _systems_in_words(both: Sequence[HeightSource], given: Sequence[SurfaceLike]) -> tuple[str, ...]:
    """What the user should know of the systems of test and control; ground points (pickets) never state theirs."""
    points = [file is not None and file.suffix == ".parquet" for file in map(_file, given)]
    silent = "" if any(points) else silent_in_words([one.crs for one in both], [_name(one) for one in given])
    said = [silent] if silent else []
    own, other = (heights_of(one.crs) for one in both)
    if own and other and not same_system(height_system(own), height_system(other)):
        from aerotri.rasters.height_systems import height_system_in_words

        said.append(
            f"heights of the test surface are in {height_system_in_words(own)}, of the control in "
            f"{height_system_in_words(other)}: this is in the differences"
        )
    return tuple(said)


def _name(surface: SurfaceLike) -> str:
    return Path(surface).name if isinstance(surface, str | os.PathLike) else as_surface(surface).label


def _lasting_of(surface: SurfaceLike) -> Lasting:
    """Errors that do not average out, of a dense surface in memory, a file or the folder of one; none of others."""
    from aerotri.formats.files.heights import file_of_surface
    from aerotri.public.cell_noise import lasting_of_dense, lasting_of_file
    from aerotri.public.dense import DenseSurface

    if isinstance(surface, DenseSurface):
        return lasting_of_dense(surface)
    path = _file(surface)
    return lasting_of_file(None if path is None else file_of_surface(path))


def _sources(test: SurfaceLike, control: SurfaceLike, stack: ExitStack) -> tuple[HeightSource, HeightSource]:
    """Both surfaces; one that does not count in metres is brought to the CRS of the other."""
    from aerotri.formats.files.heights import common_crs, heights_of_file, heights_of_raster

    both = (test, control)
    files = [_file(one) for one in both]
    held = [plan_of(as_surface(one).crs or "") for one, path in zip(both, files, strict=True) if path is None]
    crs = next(filter(None, held), None) or common_crs(*(path for path in files if path is not None))
    found = [
        heights_of_raster(stack.enter_context(as_surface(one).reader())) if path is None
        else heights_of_file(path, stack, crs)
        for one, path in zip(both, files, strict=True)
    ]  # fmt: skip
    return found[0], found[1]


def _file(surface: SurfaceLike) -> Path | None:
    """The file or folder of a surface, None for one in memory."""
    return Path(surface) if isinstance(surface, str | os.PathLike) else as_surface(surface).path


def _write(target: Path, found: SurfaceComparison, plots: bool) -> None:
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.formats.results.json_text import write_json
    from aerotri.rasters.grids import write_raster
    from aerotri.rasters.surface_files import make_cloud_optimised

    c = found.record
    with atomic_folder(target, own=OWN_NAMES) as folder:
        write_raster(folder / DIFFERENCE, c.difference, c.grid, found.crs, "test − control, m")
        make_cloud_optimised(folder / DIFFERENCE)
        if plots:
            from aerotri.report.plots.rendering import save_plots

            save_plots({"difference": found.plot()}, folder / "plots")
        write_json(folder / RECORD, found.summary)
