"""What systematic image errors do to stereo models: predicted from a self-calibrated result."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.crs_text import same_system, system_in_words
from aerotri.deformation.block_models import BlockDeformation
from aerotri.deformation.model_grid import Deformation
from aerotri.public.adjustment import Adjustment
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.optional import optional_module
from aerotri.public.progress import ProgressLike, StageReport, stage_report
from aerotri.public.results import open_result
from aerotri.public.used_arguments import used_arguments
from aerotri.results.head import Head

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.deformation.model_grid import Ground
    from aerotri.deformation.restitution import Restitution
    from aerotri.results.adjustment import Adjustment as Record

RECORD = "deform.json"
OWN_NAMES = (
    RECORD, "dX.tif", "dY.tif", "dZ.tif", "sigma_dX.tif", "sigma_dY.tif", "sigma_dZ.tif", "model.tif", "models.csv",
    "seams.csv", "plots",
)  # fmt: skip
Variant = Literal["free", "absorbed"]


@dataclass(frozen=True, eq=False)
class ModelDeformation:
    """The deformation of a stereo model, or of all models of a block, over a grid of nodes.

    Parameters
    ----------
    record : the numbers as arrays. block : name of the block. notes : what was done with the DEM, in sentences.
    head : of files. settings : every argument that was used, as deform.json has them.
    """

    record: Deformation | BlockDeformation
    block: str
    notes: tuple[str, ...] = ()
    head: Head = field(default_factory=Head)
    settings: list[dict[str, Any]] = field(default_factory=list)

    @property
    def x(self) -> np.ndarray:
        """(nx,) m, rising, in the coordinate system of the block; along the flight for a stated end lap."""
        return self.record.x

    @property
    def y(self) -> np.ndarray:
        """(ny,) m, falling."""
        return self.record.y

    @property
    def dX(self) -> np.ndarray:
        """(ny, nx) m, wrong − true; NaN off the models."""
        return self.record.d[..., 0]

    @property
    def dY(self) -> np.ndarray:
        """(ny, nx) m, as dX."""
        return self.record.d[..., 1]

    @property
    def dZ(self) -> np.ndarray:
        """(ny, nx) m, as dX: the error of heights."""
        return self.record.d[..., 2]

    @property
    def sigma_dZ(self) -> np.ndarray:
        """(ny, nx) m, σ of dZ from the covariance of the additional parameters."""
        return self.record.sigma[..., 2]

    @property
    def summary(self) -> dict[str, Any]:
        """The content of deform.json: extremes, RMS, height-to-base ratio, cm per µm."""
        from aerotri.formats.results.deformation import block_deformation_json, deformation_json

        if isinstance(self.record, BlockDeformation):
            found = block_deformation_json(self.record, self.block)
        else:
            found = deformation_json(self.record, self.block)
        return self.head.as_dict() | found | {"settings": self.settings}

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` with dX, dY, dZ and their σ over y and x.

        Raises
        ------
        InputError
            When xarray is not installed.
        """
        xarray = optional_module("xarray", "dX, dY, dZ are arrays of numpy")
        values = {}
        for k, axis in enumerate("XYZ"):
            values[f"d{axis}"] = (("y", "x"), self.record.d[..., k], {"units": "m"})
            values[f"sigma_d{axis}"] = (("y", "x"), self.record.sigma[..., k], {"units": "m"})
        return xarray.Dataset(values, {"x": self.x, "y": self.y}, {"crs": self.record.crs})

    def plot(self) -> Figure:
        """Contours of dZ over the model or the block."""
        from aerotri.report.plots.deformation import plot_block_deformation, plot_deformation

        if isinstance(self.record, BlockDeformation):
            return plot_block_deformation(self.record, self.block)
        return plot_deformation(self.record, self.block)

    def plot_profiles(self) -> Figure:
        """Profiles of dZ along and across the base.

        Raises
        ------
        InputError
            For a whole block.
        """
        from aerotri.report.plots.deformation import plot_deformation_profile

        if isinstance(self.record, BlockDeformation):
            raise InputError("profiles are drawn of one model", "choose a pair or an end lap")
        return plot_deformation_profile(self.record, self.block)

    def save(self, out: FilePath, plots: bool = True) -> Path:
        """Write rasters of dX, dY, dZ and their σ, deform.json and the plots into a folder.

        Raises
        ------
        InputError
            When the folder holds other files, or cannot be written to.
        """
        target = Path(out)
        refuse_foreign_folder(target, RECORD)
        _write(target, self, plots)
        return target


def deform(
    result: Adjustment | FilePath,
    *,
    pair: tuple[str, str] | None = None,
    end_lap: float | None = None,
    step: int = 1,
    variant: Variant = "free",
    dem: FilePath | None = None,
    spacing: float | None = None,
    gsd: float | None = None,
    group: str | None = None,
    progress: ProgressLike = None,
) -> ModelDeformation:
    """What the systematic image errors of a result do to stereo models; of the whole block where nothing is chosen.

    Parameters
    ----------
    result : an adjustment with additional parameters, or the folder of one.
    pair : two photographs, left and right as flown.
    end_lap : of a model in normal case, such as 0.663, over flat ground.
    step : of a whole block: every photograph with the step-th after it in its strip.
    variant : 'free': orientation of the result, photographs used uncorrected; 'absorbed': orientation of an adjustment
        without parameters, which takes over a part of the errors.
    dem : raster of the ground; flat at the mean height of the object points without.
    spacing : m between nodes.
    gsd : m, of a model at a stated end lap, in place of the block's own.
    group : parameter group of such a model; that of most photographs without.
    progress : as of `aerotri.adjust`.

    Returns
    -------
    ModelDeformation
        Wrong − true, m.

    Raises
    ------
    InputError
        For options that do not go together, a photograph that the block does not have, or a result without image
        errors.

    Examples
    --------
    >>> import aerotri
    >>> block = aerotri.simulate(aerotri.example_flight(), seed=1).block
    >>> result = aerotri.adjust(block, parameters="brown:K1+K2")
    >>> grid = aerotri.deform(result, end_lap=0.75, spacing=20.0)
    >>> grid.dZ.shape == grid.sigma_dZ.shape
    True
    """
    from aerotri.deformation.model_grid import deform_normal_case, deform_pair
    from aerotri.deformation.restitution import VARIANTS, restitution_of

    if variant not in VARIANTS:
        raise InputError(f"there is no variant '{variant}'", f"choose {' or '.join(VARIANTS)}")
    _refuse_contradictions(pair, end_lap, dem, gsd, group)
    record = (result if isinstance(result, Adjustment) else open_result(result)).record
    name = str(record.result.block.name)
    with stage_report(progress) as report, ExitStack() as stack:
        report.stage("orientation", None)
        models = restitution_of(record, variant)
        refuse_without_errors(models, name)
        block = record.result.block
        head, notes = Head(block.project, block.crs), ()
        report.stage("deformation", None)
        if end_lap is not None:
            found = deform_normal_case(record, models, end_lap, spacing, group, gsd)
        else:
            ground, notes = _ground(record, dem, stack)
            if pair is not None:
                found = deform_pair(record, models, pair, ground, spacing)
            else:
                found = _of_block(record, models, ground, spacing, step, report)
    asked = {
        "pair": pair, "end_lap": end_lap, "step": step, "variant": variant, "dem": dem, "spacing": spacing, "gsd": gsd,
        "group": group,
    }  # fmt: skip
    return ModelDeformation(found, name, notes, head, used_arguments(deform, asked, {"spacing": "m", "gsd": "m"}))


def _of_block(
    record: Record, models: Restitution, ground: Ground, spacing: float | None, step: int, report: StageReport
) -> BlockDeformation:
    from aerotri.deformation.block_models import deform_block

    return deform_block(
        record, models, ground, spacing, step, lambda done, count: report.counted("deformation", done, count)
    )


def _refuse_contradictions(
    pair: tuple[str, str] | None, end_lap: float | None, dem: FilePath | None, gsd: float | None, group: str | None
) -> None:
    if pair is not None and end_lap is not None:
        raise InputError("a pair and an end lap are both given", "choose one of them")
    if end_lap is not None and dem is not None:
        raise InputError("a model at a stated end lap has flat ground", "give the DEM with a pair or the whole block")
    if end_lap is None and (gsd is not None or group is not None):
        raise InputError("GSD and group belong to a stated end lap", "leave them out")


def refuse_without_errors(models: Restitution, name: str) -> None:
    """Without image errors nothing is deformed.

    Raises
    ------
    InputError
    """
    if all(errors.function.is_zero for errors in models.errors):
        remedy = "adjust with additional parameters, such as --parameters bluh:1-12"
        raise InputError(f"'{name}' has no image errors, so its models are not deformed", remedy)


def _ground(record: Record, dem: FilePath | None, stack: ExitStack) -> tuple[Ground, tuple[str, ...]]:
    """The DEM, open as long as the stack, or the level of the object points; and what was done with it."""
    from aerotri.deformation.model_grid import DemGround, FlatGround, mean_ground
    from aerotri.rasters.grids import RasterReader, horizontal_crs
    from aerotri.rasters.metric import MetricReader, refuse_other_units

    if dem is None:
        return FlatGround(mean_ground(record)), ()
    place, own = Path(dem), horizontal_crs(record.result.block.crs)
    reader = stack.enter_context(MetricReader(place, target=own))
    if own is None and reader.note:
        # where a local block lies in that CRS nobody knows
        refuse_other_units(stack.enter_context(RasterReader(place)))
    check_crs(record, reader.plan, place)
    return DemGround(reader), (reader.note,) if reader.note else ()


def check_crs(record: Record, plan: str, dem: Path) -> None:
    """Refuse a DEM in another CRS than the block's; one without a CRS is taken for one in the block's.

    Raises
    ------
    InputError
    """
    from aerotri.rasters.grids import horizontal_crs

    own = horizontal_crs(record.result.block.crs)
    if own is not None and plan and not same_system(own, plan):
        message = f"is in {system_in_words(plan)}, the block in {own}"
        raise InputError(message, "bring the DEM into the CRS of the block", dem)


def _write(target: Path, found: ModelDeformation, plots: bool) -> None:
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.formats.results.json_text import write_json
    from aerotri.rasters.grids import Grid, horizontal_crs, write_raster

    d = found.record
    crs = None if d.crs == "model" else horizontal_crs(d.crs)
    grid = Grid.of_nodes(d.x, d.y)
    with atomic_folder(target, own=OWN_NAMES) as folder:
        for k, axis in enumerate("XYZ"):
            write_raster(folder / f"d{axis}.tif", d.d[..., k], grid, crs, f"d{axis}, wrong − true, m")
            write_raster(folder / f"sigma_d{axis}.tif", d.sigma[..., k], grid, crs, f"σ of d{axis}, m")
        if isinstance(d, BlockDeformation):
            write_raster(folder / "model.tif", d.number.astype(np.int32), grid, crs, "number of the model")
            _write_tables(folder, d)
        if plots:
            from aerotri.report.plots.rendering import save_plots

            whole = isinstance(d, BlockDeformation)
            figures = {"block": found.plot()} if whole else {
                "contours": found.plot(), "profiles": found.plot_profiles()
            }  # fmt: skip
            save_plots(figures, folder / "plots")
        write_json(folder / RECORD, found.summary)


def _write_tables(folder: Path, d: BlockDeformation) -> None:
    """models.csv, which `demcor --models model.tif` takes, and seams.csv."""
    import csv

    from aerotri.spreadsheet import plain_row

    with (folder / "models.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["number", "left", "right"])
        writer.writerows(plain_row([k, *one.model.names]) for k, one in enumerate(d.models))
    with (folder / "seams.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["first_left", "first_right", "second_left", "second_right", "nodes", "mean", "rms", "max"])
        for seam in d.seams:
            names = (*d.models[seam.first].model.names, *d.models[seam.second].model.names)
            writer.writerow(plain_row([*names, seam.count, seam.mean, seam.rms, seam.max]))
