"""How far apart the points of a surface should be measured, before it is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pyarrow as pa

from aerotri.conventions import FilePath, InputError
from aerotri.public.adjustment import Adjustment
from aerotri.public.progress import ProgressLike, StageReport, stage_report
from aerotri.public.results import open_result
from aerotri.public.table import Table

if TYPE_CHECKING:
    from aerotri.results.adjustment import Adjustment as Record
    from aerotri.terrain.interval import Pilot

Corners = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False, repr=False)
class IntervalPrediction:
    """Intervals between pickets, the points measured by image matching.

    Parameters
    ----------
    gsd : m, size of a pixel on the ground.
    by_formula : m, smallest and largest interval by the kind of terrain (Tran 2007).
    older_rule : m, 30·GSD.
    pilot : what a part that was measured says; None without.
    tolerance : m, RMSE between pickets that was allowed; None: σ of a picket.
    """

    gsd: float
    by_formula: dict[str, tuple[float, float]]
    older_rule: float
    pilot: Pilot | None = None
    tolerance: float | None = None

    @property
    def summary(self) -> dict[str, Any]:
        """What the command prints as JSON."""
        content: dict[str, Any] = {
            "gsd_m": self.gsd,
            "interval_m": {name: list(ends) for name, ends in self.by_formula.items()},
            "older_rule_m": self.older_rule,
        }
        if self.pilot is not None:
            p = self.pilot
            content["pilot"] = {
                "interval_m": p.chosen, "k": p.chosen / (1e3 * np.sqrt(self.gsd)), "area_m2": p.area_m2,
                "sigma_of_a_picket_m": p.noise, "tolerance_m": self.tolerance, "tried": _tried(p),
            }  # fmt: skip
        return content

    @property
    def table(self) -> Table:
        """Of a pilot a row an interval that was tried, else one a kind of terrain."""
        rows = _tried(self.pilot) if self.pilot is not None else [
            {"terrain": name, "smallest_m": low, "largest_m": high} for name, (low, high) in self.by_formula.items()
        ]  # fmt: skip
        columns = pa.Table.from_pylist(rows)
        units = {name: "m" for name in columns.column_names if name.endswith("_m")}
        return Table("intervals between pickets", columns, units)

    def __repr__(self) -> str:
        return f"<aerotri.IntervalPrediction, GSD {self.gsd:.3f} m>"

    def _repr_html_(self) -> str:
        return self.table.html()


def picket_interval(
    *,
    scan_um: float | None = None,
    scale: float | None = None,
    gsd: float | None = None,
    k: float | None = None,
    pilot: Adjustment | FilePath | None = None,
    photographs: FilePath | Sequence[FilePath] = (),
    area: Corners | None = None,
    tolerance: float | None = None,
    progress: ProgressLike = None,
) -> IntervalPrediction:
    """How far apart pickets should be: by formula from scan and scale or GSD, or by a pilot.

    Parameters
    ----------
    scan_um : size of a pixel in the image, µm; together with `scale`.
    scale : denominator of the photo scale.
    gsd : m, size of a pixel on the ground, in place of both.
    k : coefficient of the formula; 0.08–0.09 for mountains, 0.1 for a plain where None.
    pilot : a result, or the folder of one: measure a part and see.
    photographs : of the pilot, folder or files.
    area : of the pilot, m: X and Y of the lower left, X and Y of the upper right corner; the middle where None.
    tolerance : of the pilot, m: RMSE allowed between pickets; σ of a picket where None.
    progress : see `aerotri.adjust`.

    Returns
    -------
    IntervalPrediction

    Raises
    ------
    InputError
        When the photographs are not stated in one way, or hardly anything could be matched.

    Examples
    --------
    >>> found = picket_interval(scan_um=28.0, scale=7000.0)
    >>> [round(width, 1) for width in found.by_formula["plain"]]
    [42.1, 46.5]
    """
    from aerotri.public.folders import paths_of

    if any(value is not None and not value > 0.0 for value in (scan_um, scale, gsd, k, tolerance)):
        raise InputError("sizes have to be positive", "give micrometres and metres")
    files = paths_of(photographs)
    stated = stated_gsd(scan_um, scale, gsd, pilot is not None, bool(files))
    if stated is not None:
        return by_formula(stated, k)
    record = (pilot if isinstance(pilot, Adjustment) else open_result(cast(FilePath, pilot))).record
    with stage_report(progress) as report:
        return _by_pilot(record, files, area, tolerance, report)


def error_pickets(share: float, area: float, interval: np.ndarray | float) -> np.ndarray | float:
    """How many pickets of an area will be in error, by the law e = p·S/PSI² (Tran 2007).

    Parameters
    ----------
    share : p, of the pickets that are in error, 0 … 1.
    area : S, m².
    interval : PSI, m between pickets, one or several.

    Examples
    --------
    >>> float(error_pickets(0.1, 1e6, 50.0))
    40.0
    """
    from aerotri.terrain.interval import expected_error_pickets

    return expected_error_pickets(share, area, interval)


def stated_gsd(
    scan_um: float | None, scale: float | None, gsd: float | None, has_pilot: bool, has_photographs: bool
) -> float | None:
    """m, the GSD that scan and scale, or the user, state; None for a pilot.

    Raises
    ------
    InputError
        When the photographs are not stated in one way.
    """
    both = scan_um is not None and scale is not None
    if (scan_um is None) != (scale is None):
        raise InputError("--scan-um and --scale belong together", "give both, or --gsd")
    if both + (gsd is not None) + has_pilot != 1:
        raise InputError(
            "the size of a pixel on the ground has to be given in exactly one way",
            "give --scan-um and --scale, or --gsd, or --pilot",
        )
    if has_pilot and not has_photographs:
        raise InputError("a pilot needs photographs", "give --photographs FOLDER")
    return 1e-6 * scan_um * scale if scan_um is not None and scale is not None else gsd


def by_formula(gsd: float, k: float | None) -> IntervalPrediction:
    """Tran's formula and the older rule.

    Parameters
    ----------
    gsd : m. k : coefficient; None: those of mountains and plains.
    """
    from aerotri.terrain.interval import K_MOUNTAINS, K_PLAIN, interval_by_rule, interval_of_gsd

    kinds = {"mountains": K_MOUNTAINS, "plain": K_PLAIN} if k is None else {"as stated": (k, k)}
    found = {name: (interval_of_gsd(gsd, low), interval_of_gsd(gsd, high)) for name, (low, high) in kinds.items()}
    return IntervalPrediction(gsd, found, interval_by_rule(gsd))


def _by_pilot(
    record: Record, files: Sequence[Any], area: Corners | None, tolerance: float | None, report: StageReport
) -> IntervalPrediction:
    from aerotri.public.terrain import terrain_plan
    from aerotri.terrain.dtm import make_terrain_model, typical_slope
    from aerotri.terrain.photographs import photographs_of
    from aerotri.terrain.pilot import dense_interval, middle_area, pilot_of
    from aerotri.terrain.settings import TerrainSettings

    settings = TerrainSettings(area=area)
    plan, _ = terrain_plan(record, files, settings)
    photographs = photographs_of(record, plan.rows, plan.paths)
    gsd = float(np.median(photographs.gsd))
    interval = dense_interval(gsd, typical_slope(record.result.points.xyz))
    settings = replace(settings, interval=interval, area=area or middle_area(photographs))
    plan, _ = terrain_plan(record, files, settings)
    outcome = make_terrain_model(record, plan, report.stage)
    found = pilot_of(outcome.pickets, interval, tolerance)
    return replace(by_formula(gsd, None), pilot=found, tolerance=tolerance)


def _tried(pilot: Pilot) -> list[dict[str, Any]]:
    return [
        {"interval_m": float(i), "rmse_m": None if np.isnan(r) else float(r), "pickets": int(n), "errors": int(e)}
        for i, r, n, e in zip(pilot.interval, pilot.rmse, pilot.pickets, pilot.errors, strict=True)
    ]
