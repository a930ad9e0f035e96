"""`aerotri deform`: what the image errors of a self-calibrated block do to its stereo models."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.commands.console import Console
from aerotri.commands.results import refuse_foreign_folder, reopened
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.deformation.block_models import BlockDeformation
    from aerotri.deformation.model_grid import Deformation, Ground
    from aerotri.deformation.restitution import Restitution
    from aerotri.pipeline import Adjustment

RECORD = "deform.json"
OWN_NAMES = (
    RECORD, "dX.tif", "dY.tif", "dZ.tif", "sigma_dX.tif", "sigma_dY.tif", "sigma_dZ.tif", "model.tif", "models.csv",
    "seams.csv", "plots",
)  # fmt: skip


@dataclass(frozen=True)
class DeformOptions:
    """What to compute, as on the command line; the whole block where nothing else is chosen."""

    pair: tuple[str, str] | None = None
    end_lap: float | None = None
    block: bool = False
    step: int = 1
    variant: str = "free"
    dem: Path | None = None
    spacing: float | None = None
    gsd: float | None = None
    group: str | None = None

    def check(self) -> None:
        """Refuse what does not go together.

        Raises
        ------
        InputError
        """
        from aerotri.deformation.restitution import VARIANTS

        chosen = [name for name, given in (("--pair", self.pair), ("--end-lap", self.end_lap), ("--block", self.block))
                  if given not in (None, False)]  # fmt: skip
        if len(chosen) > 1:
            raise InputError(f"{' and '.join(chosen)} are both given", "choose one of them")
        if self.variant not in VARIANTS:
            raise InputError(f"there is no variant '{self.variant}'", f"choose {' or '.join(VARIANTS)}")
        if self.end_lap is not None and self.dem is not None:
            raise InputError("a model at a stated end lap has flat ground", "give --dem with --pair or --block")
        if self.end_lap is None and (self.gsd is not None or self.group is not None):
            raise InputError("--gsd and --group belong to --end-lap", "leave them out")


def run_deform(source: Path, options: DeformOptions, out: Path | None, plots: bool, as_json: bool) -> int:
    """Exit code of the command; arguments as on the command line."""
    console = Console(quiet=as_json)
    options.check()
    target = out or Path(f"{source.resolve().name.removesuffix('_result')}_deformation")
    refuse_foreign_folder(target, RECORD)
    calibration = reopened(source, console)
    from aerotri.deformation.absorbed import AbsorptionFailedError
    from aerotri.deformation.restitution import restitution

    console.progress("orientation")
    try:
        of = restitution(calibration, options.variant)
    except AbsorptionFailedError as failure:
        console.failure(str(failure))
        return 1
    refuse_without_errors(of, source)
    content = _computed(calibration, of, options, target, plots, console)
    if as_json:
        print(json.dumps(content, indent=2, ensure_ascii=False))
    else:
        console.lines([*_summary(content), f"Written to {target}"])
    return 0


def refuse_without_errors(of: Restitution, source: Path) -> None:
    """Without image errors nothing is deformed.

    Raises
    ------
    InputError
    """
    if all(errors.function.is_zero for errors in of.errors):
        remedy = "adjust with additional parameters, such as --parameters bluh:1-12"
        raise InputError("has no image errors, so its models are not deformed", remedy, source)


def _computed(
    calibration: Adjustment, of: Restitution, options: DeformOptions, target: Path, plots: bool, console: Console
) -> dict[str, Any]:
    """Compute and write; returns the content of deform.json."""
    from aerotri.deformation.model_grid import deform_normal_case, deform_pair
    from aerotri.deformation.outcome_json import block_deformation_json, deformation_json

    name = str(calibration.result.block.name)
    console.progress("deformation")
    with ExitStack() as stack:
        if options.end_lap is not None:
            one = deform_normal_case(
                calibration, of, options.end_lap, options.spacing, options.group, options.gsd
            )  # fmt: skip
        elif options.pair is not None:
            ground = _ground(calibration, options, stack, console)
            one = deform_pair(calibration, of, options.pair, ground, options.spacing)
        else:
            whole = _of_block(calibration, of, options, _ground(calibration, options, stack, console), console)
            content = block_deformation_json(whole, name)
            _write(target, content, whole, _block_figures(whole, name) if plots else {})
            return content
    content = deformation_json(one, name)
    _write(target, content, one, _figures(one, name) if plots else {})
    return content


def _ground(calibration: Adjustment, options: DeformOptions, stack: ExitStack, console: Console) -> Ground:
    """The DEM, open as long as the stack, or the level of the object points."""
    from aerotri.deformation.model_grid import DemGround, FlatGround, mean_ground
    from aerotri.rasters import RasterReader, horizontal_crs
    from aerotri.rasters_metric import MetricReader, refuse_other_units

    if options.dem is None:
        return FlatGround(mean_ground(calibration))
    own = horizontal_crs(calibration.result.block.crs)
    reader = stack.enter_context(MetricReader(options.dem, target=own))
    if own is None and reader.note:
        # where a local block lies in that CRS nobody knows
        refuse_other_units(stack.enter_context(RasterReader(options.dem)))
    if reader.note:
        console.note(reader.note)
    check_crs(calibration, reader.epsg, options.dem)
    return DemGround(reader)


def check_crs(calibration: Adjustment, epsg: int | None, dem: Path) -> None:
    """Refuse a DEM in another CRS than the block's; one without a CRS is taken for one in the block's.

    Raises
    ------
    InputError
    """
    from aerotri.rasters import horizontal_crs

    own = horizontal_crs(calibration.result.block.crs)
    if own is not None and epsg is not None and own.upper() != f"EPSG:{epsg}":
        raise InputError(f"is in EPSG:{epsg}, the block in {own}", "bring the DEM into the CRS of the block", dem)


def _of_block(
    calibration: Adjustment, of: Restitution, options: DeformOptions, ground: Ground, console: Console
) -> BlockDeformation:
    from aerotri.deformation.block_models import deform_block

    return deform_block(
        calibration, of, ground, options.spacing, options.step,
        lambda done, count: console.work("models", done / max(count, 1), f"{done} of {count}"),
    )  # fmt: skip


def _figures(deformation: Deformation, name: str) -> dict[str, Figure]:
    from aerotri.report.plots_deformation import plot_deformation, plot_deformation_profile

    return {"contours": plot_deformation(deformation, name), "profiles": plot_deformation_profile(deformation, name)}


def _block_figures(deformation: BlockDeformation, name: str) -> dict[str, Figure]:
    from aerotri.report.plots_deformation import plot_block_deformation

    return {"block": plot_block_deformation(deformation, name)}


def _write(
    target: Path, content: dict[str, Any], deformation: Deformation | BlockDeformation, figures: dict[str, Figure]
) -> None:
    from aerotri.deformation.block_models import BlockDeformation
    from aerotri.formats.atomic import atomic_folder
    from aerotri.rasters import Grid, horizontal_crs, write_raster

    d = deformation
    crs = None if d.crs == "model" else horizontal_crs(d.crs)
    grid = Grid.of_nodes(d.x, d.y)
    with atomic_folder(target, own=OWN_NAMES) as folder:
        for k, axis in enumerate("XYZ"):
            write_raster(folder / f"d{axis}.tif", d.d[..., k], grid, crs, f"d{axis}, wrong − true, m")
            write_raster(folder / f"sigma_d{axis}.tif", d.sigma[..., k], grid, crs, f"σ of d{axis}, m")
        if isinstance(d, BlockDeformation):
            write_raster(folder / "model.tif", d.number.astype(np.int32), grid, crs, "number of the model")
            _write_tables(folder, d)
        if figures:
            from aerotri.report.rendering import save_plots

            save_plots(figures, folder / "plots")
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
        (folder / RECORD).write_text(text + "\n", encoding="utf-8")


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


def _summary(content: dict[str, Any]) -> list[str]:
    from aerotri.report.quality import printable

    c = content
    lines = [f"{printable(c['title'])}, {c['variant']}, {c['nodes']} nodes every {c['spacing_m']:g} m"]
    if "h_over_b" in c:
        lines.append(
            f"end lap {100 * c['end_lap']:.1f} %, h/b {c['h_over_b']:.2f}, base {c['base_mm']:.2f} mm, GSD "
            f"{c['gsd_m']:.3f} m, 1 µm of x-parallax {c['cm_per_um']:.2f} cm"
        )
    for axis in ("dX", "dY", "dZ"):
        s = c[axis]
        lines.append(f"{axis}  {s['min']:+.3f} … {s['max']:+.3f} m, mean {s['mean']:+.3f}, RMS {s['rms']:.3f}")
    s = c["sigma_dZ"]
    lines.append(f"σ of dZ  {s['min']:.4f} … {s['max']:.4f} m, mean {s['mean']:.4f}: {c['sigma_includes']}")
    if "seams" in c and c["seams"]["count"]:
        seams = c["seams"]
        lines.append(f"steps between neighbouring models: RMS {seams['rms']:.3f} m at {seams['count']} seams; worst:")
        for seam in seams["worst"][:5]:
            first, second = (printable(", ".join(seam[key])) for key in ("first", "second"))
            step = f"RMS {seam['rms']:.3f} m, mean {seam['mean']:+.3f}, {seam['nodes']} nodes"
            lines.append(f"  {first} | {second}: {step}")
    return lines
