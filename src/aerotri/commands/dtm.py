"""`aerotri dtm`: pickets by matching, and the surfaces they make."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.commands.console import Console
from aerotri.commands.results import reopened
from aerotri.conventions import InputError, stated_number
from aerotri.public.folders import refuse_foreign_folder

if TYPE_CHECKING:
    from aerotri.results.adjustment import Adjustment
    from aerotri.terrain.dtm import TerrainOutcome, TerrainPlan

OWN_NAMES = ("dtm.json", "pickets.parquet", "pickets.laz", "dsm.tif", "dtm.tif", "model.tif", "models.csv", "plots")
SUBSETS = ("all", "even", "odd")
EDGE, EDGE_OF_PAIRS = 0.02, 0.10
"""Share of the format at its edge not used: of pairs as Tran (2007) has it; where more vouch for a picket, less."""
ENDINGS = (".tif", ".tiff", ".jpg", ".jpeg")


@dataclass(frozen=True)
class DtmOptions:
    """As on the command line; `interval` and `cell` None: computed; `edge` None: as `EDGE` has it."""

    interval: float | None = None
    cell: float | None = None
    pairs: bool = False
    step: int | None = None
    subset: str = "all"
    area: tuple[float, float, float, float] | None = None
    window: int = 17
    threshold: float = 0.90
    agreeing: float = 0.50
    edge: float | None = None
    most_photographs: int = 8
    breaklines: Path | None = None
    ideal: bool = False
    plots: bool = True

    def check(self) -> None:
        """Refuse what makes no sense.

        Raises
        ------
        InputError
        """
        if self.subset not in SUBSETS:
            raise InputError(f"there is no subset '{self.subset}'", f"choose one of {', '.join(SUBSETS)}")
        if self.window % 2 == 0 or self.window < 5:
            raise InputError(f"a window of {self.window} has no middle", "give an odd number from 5 on")
        if self.interval is not None and not self.interval > 0.0:
            raise InputError(f"an interval of {self.interval:g} m is none", "give metres, or leave it out")
        if self.area is not None and not (self.area[0] < self.area[2] and self.area[1] < self.area[3]):
            raise InputError("the area is empty", "give X and Y of its lower left, then of its upper right corner")


def metres_or_auto(text: str) -> float | None:
    """The interval of the command line; None for auto.

    Raises
    ------
    InputError
    """
    if text == "auto":
        return None
    try:
        return stated_number(text)
    except ValueError:
        raise InputError(f"--interval '{text}' is none", "give metres, or auto") from None


def run_dtm(source: Path, photographs: list[Path], out: Path | None, options: DtmOptions, as_json: bool) -> int:
    """Exit code of the command; arguments as on the command line."""
    console = Console(quiet=as_json)
    options.check()
    target = out or Path(f"{source.resolve().name.removesuffix('_result')}_dtm")
    refuse_foreign_folder(target, "dtm.json")
    calibration = reopened(source, console)
    plan = make_plan(calibration, photographs, options, None if as_json else console)
    from aerotri.terrain.dtm import make_terrain_model

    outcome = make_terrain_model(calibration, plan, console.work)
    console.progress("writing")
    content = write_terrain(target, outcome, calibration, options.plots)
    if as_json:
        print(json.dumps(content, indent=2, ensure_ascii=False))
    else:
        console.lines([*summary(content), f"Written to {target}"])
    return 0


def make_plan(
    calibration: Adjustment, given: list[Path], options: DtmOptions, console: Console | None = None
) -> TerrainPlan:
    """Which photographs are matched, where and how.

    Raises
    ------
    InputError
    """
    from aerotri.formats.files.photograph_files import match_files, photographs_in
    from aerotri.formats.foreign.breaklines import breaklines_and_note
    from aerotri.rasters.grids import horizontal_crs
    from aerotri.terrain.dtm import TerrainPlan, chosen_rows
    from aerotri.terrain.pickets import Area

    files = [f for f in photographs_in(given, ENDINGS) if f.suffix.lower() in ENDINGS]
    found = match_files(files, calibration.result.block.images.names)
    path_of = {int(row): file for row, file in zip(found, files, strict=True) if row >= 0}
    rows = np.array([r for r in chosen_rows(calibration, options.subset) if r in path_of], dtype=np.int64)
    if len(rows) < 2:
        where = ", ".join(str(path) for path in given) or "nothing"
        raise InputError(f"{len(rows)} photographs of the block are in {where}", "give the folder that holds them")
    area = None
    if options.area is not None:
        area = Area(np.array(options.area[:2]), np.array(options.area[2:]))
    lines = ()
    if options.breaklines is not None:
        lines, note = breaklines_and_note(options.breaklines, horizontal_crs(calibration.result.block.crs))
        if note and console is not None:
            console.lines([f"note: {note}"])
    pairs = options.pairs or options.step is not None
    edge = options.edge if options.edge is not None else EDGE_OF_PAIRS if pairs else EDGE
    return TerrainPlan(
        rows=rows, paths=tuple(path_of[int(r)] for r in rows), interval=options.interval, cell=options.cell,
        pairs=pairs, step=options.step, area=area, window_px=options.window,
        threshold=options.threshold, agreeing=options.agreeing, edge=edge,
        most_photographs=options.most_photographs, breaklines=lines, ideal=options.ideal,
    )  # fmt: skip


def write_terrain(target: Path, outcome: TerrainOutcome, calibration: Adjustment, plots: bool) -> dict[str, Any]:
    """Write all files whole or not at all; returns the content of dtm.json."""
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.formats.results.pickets import write_pickets
    from aerotri.formats.results.point_cloud import write_point_cloud
    from aerotri.rasters.grids import horizontal_crs, write_raster, write_surface
    from aerotri.terrain.dtm import terrain_json
    from aerotri.volume.shared import adjustment_key

    block, p = calibration.result.block, outcome.pickets
    crs = horizontal_crs(block.crs)
    content = terrain_json(outcome, str(block.name), block.crs) | {"adjustment": adjustment_key(calibration)}
    with atomic_folder(target, own=OWN_NAMES) as folder:
        write_pickets(folder / "pickets.parquet", p, outcome.adjustment)
        own = p.accepted
        sigma = np.sqrt(p.covariance[own, 2, 2] + outcome.adjustment[own, 2])
        write_point_cloud(folder / "pickets.laz", p.xyz[own], sigma, outcome.ground[own], crs)
        for name, surface in (("dsm", outcome.dsm), ("dtm", outcome.dtm)):
            write_surface(folder / f"{name}.tif", surface.z, surface.sigma, surface.grid, crs, f"{name.upper()} Z, m")
        if outcome.models is not None:
            write_raster(folder / "model.tif", outcome.number, outcome.dsm.grid, crs, "number of the model")
            _write_models(folder / "models.csv", p.names, outcome.models.pairs)
        if plots:
            from aerotri.report.plots.rendering import save_plots
            from aerotri.report.plots.terrain import plot_pickets, plot_surface

            name = str(block.name)
            figures = {"surface": plot_surface(outcome, name), "pickets": plot_pickets(outcome, name)}
            save_plots(figures, folder / "plots")
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
        (folder / "dtm.json").write_text(text + "\n", encoding="utf-8")
    return content


def _write_models(path: Path, names: np.ndarray, pairs: np.ndarray) -> None:
    import csv

    from aerotri.spreadsheet import plain_row

    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["number", "left", "right"])
        writer.writerows(plain_row([k, names[a], names[b]]) for k, (a, b) in enumerate(pairs.tolist()))


def summary(content: dict[str, Any]) -> list[str]:
    """What the user reads."""
    c = content
    p = c["pickets"]
    lines = [
        f"{c['photographs']} photographs, GSD {c['gsd_m']:.3f} m; pickets every {c['interval_m']:g} m"
        f" ({c['interval_source']}), raster cells of {c['cell_m']:g} m",
        f"{p['accepted']} of {p['seen']} nodes that are seen accepted, {p['errors']} error pickets, "
        f"{p['stepped_aside']} stepped aside, {p['holes']} holes",
    ]
    reasons = [f"{n} {name}" for name, n in c["status"].items() if n and name not in ("accepted", "not seen")]
    if reasons:
        lines.append("not accepted: " + ", ".join(reasons))
    s = c["sigma_Z_m"]
    lines.append(
        f"σ of Z: median {s['median']:.3f} m (matching {s['matching']:.3f}, adjustment {s['adjustment']:.3f}; "
        f"between pickets {s['interpolation']:.3f}); parallax of the rays σ̂ {c['ray_sigma_px']:.3f} px"
    )
    lines.append(f"{c['ground_share'] * 100:.0f} % of the pickets are ground")
    return lines
