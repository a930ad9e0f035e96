"""`aerotri predict picket-interval`: how far apart pickets should be."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.commands.console import Console
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from aerotri.terrain.interval import Pilot

FACTORS = (2, 3, 4, 6, 8)
PILOT_SHARE, FEWEST_PX = 0.25, 10.0
"""Interval of the pilot over that of the formula, but not below so many pixels."""
MIDDLE = 0.5
"""Part of the footprint's sides that a pilot takes where no area is stated."""


@dataclass(frozen=True)
class IntervalQuestion:
    """As on the command line: scan and scale, or the GSD, or a result with photographs for a pilot."""

    scan_um: float | None = None
    scale: float | None = None
    gsd: float | None = None
    k: float | None = None
    pilot: Path | None = None
    photographs: tuple[Path, ...] = ()
    area: tuple[float, float, float, float] | None = None
    tolerance: float | None = None

    def gsd_m(self) -> float | None:
        """GSD that scan and scale, or the user, state; None for a pilot.

        Raises
        ------
        InputError
        """
        both = self.scan_um is not None and self.scale is not None
        if (self.scan_um is None) != (self.scale is None):
            raise InputError("--scan-um and --scale belong together", "give both, or --gsd")
        if both + (self.gsd is not None) + (self.pilot is not None) != 1:
            raise InputError("the photographs are not stated once", "give --scan-um and --scale, or --gsd, or --pilot")
        if self.pilot is not None and not self.photographs:
            raise InputError("a pilot needs photographs", "give --photographs FOLDER")
        return 1e-6 * self.scan_um * self.scale if self.scan_um is not None and self.scale is not None else self.gsd


def run_predict_interval(question: IntervalQuestion, as_json: bool) -> None:
    """Answer and print."""
    gsd = question.gsd_m()
    content = _by_formula(gsd, question.k) if gsd is not None else _by_pilot(question, Console(quiet=as_json))
    print(json.dumps(content, indent=2, ensure_ascii=False) if as_json else "\n".join(_summary(content)))


def _by_formula(gsd: float, k: float | None) -> dict[str, Any]:
    from aerotri.terrain.interval import K_MOUNTAINS, K_PLAIN, interval_by_rule, interval_of_gsd

    kinds = {"mountains": K_MOUNTAINS, "plain": K_PLAIN} if k is None else {"as stated": (k, k)}
    found = {name: [interval_of_gsd(gsd, value) for value in values] for name, values in kinds.items()}
    return {"gsd_m": gsd, "interval_m": found, "older_rule_m": interval_by_rule(gsd)}


def _by_pilot(question: IntervalQuestion, console: Console) -> dict[str, Any]:
    from aerotri.commands.results import reopened
    from aerotri.public.terrain import terrain_plan
    from aerotri.terrain.dtm import make_terrain_model, typical_slope
    from aerotri.terrain.interval import interval_of_gsd, k_of_slope
    from aerotri.terrain.photographs import photographs_of
    from aerotri.terrain.pickets import footprint
    from aerotri.terrain.settings import TerrainSettings

    calibration = reopened(Path(str(question.pilot)), console)
    plan, _ = terrain_plan(calibration, list(question.photographs), TerrainSettings(area=question.area))
    photographs = photographs_of(calibration, plan.rows, plan.paths)
    gsd = float(np.median(photographs.gsd))
    k, _ = k_of_slope(typical_slope(calibration.result.points.xyz))
    interval = max(PILOT_SHARE * interval_of_gsd(gsd, k), FEWEST_PX * gsd)
    area = question.area
    if area is None:
        whole = footprint(photographs)
        middle, half = 0.5 * (whole.low + whole.high), 0.5 * MIDDLE * (whole.high - whole.low)
        low, high = middle - half, middle + half
        area = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    plan, _ = terrain_plan(calibration, list(question.photographs), TerrainSettings(interval=interval, area=area))
    outcome = make_terrain_model(calibration, plan, console.work)
    console.lines([])
    pilot = pilot_of(outcome.pickets, interval, question.tolerance)
    content = _by_formula(gsd, None)
    content["pilot"] = {
        "interval_m": pilot.chosen, "k": pilot.chosen / (1e3 * np.sqrt(gsd)), "area_m2": pilot.area_m2,
        "sigma_of_a_picket_m": pilot.noise, "tolerance_m": question.tolerance,
        "tried": [
            {"interval_m": float(i), "rmse_m": None if np.isnan(r) else float(r), "pickets": int(n), "errors": int(e)}
            for i, r, n, e in zip(pilot.interval, pilot.rmse, pilot.pickets, pilot.errors, strict=True)
        ],
    }  # fmt: skip
    return content


def pilot_of(pickets, interval: float, tolerance: float | None) -> Pilot:
    """What pickets on a dense grid say of wider ones.

    The surface between wide pickets is judged by the dense ones. Without a tolerance the interval is chosen at which it
    is as wrong as a picket itself: closer pickets then show noise, wider ones lose terrain [C].
    """
    from aerotri.terrain.interval import Pilot, chosen_interval
    from aerotri.terrain.picket_status import PicketStatus
    from aerotri.terrain.surface import errors_by_interval

    own = pickets.accepted
    variance = pickets.covariance[own, 2, 2]
    rmse = errors_by_interval(pickets.xyz[own], pickets.node[own], interval, FACTORS, variance)
    number = np.round(pickets.node / interval).astype(np.int64)
    kept = [(number % factor == 0).all(axis=1) for factor in FACTORS]
    noise = float(np.sqrt(np.median(variance)))
    widths = interval * np.array(FACTORS)
    return Pilot(
        interval=widths, rmse=rmse, pickets=np.array([int((own & part).sum()) for part in kept]),
        errors=np.array([int((pickets.errors & part).sum()) for part in kept]), noise=noise,
        area_m2=float((pickets.status != PicketStatus.NOT_SEEN).sum() * interval**2),
        chosen=chosen_interval(widths, rmse, noise if tolerance is None else tolerance),
    )  # fmt: skip


def _summary(content: dict[str, Any]) -> list[str]:
    c = content
    lines = [f"GSD {c['gsd_m']:.3f} m"]
    for name, (low, high) in c["interval_m"].items():
        span = f"{low:.1f} m" if low == high else f"{low:.1f} … {high:.1f} m"
        lines.append(f"{name}: pickets every {span} (Tran 2007, k·√(P·Ma))")
    lines.append(f"older rule 30·GSD: {c['older_rule_m']:.1f} m")
    if "pilot" in c:
        p = c["pilot"]
        lines.append(f"{'interval':>10}{'RMSE':>9}{'pickets':>9}{'errors':>8}")
        for t in p["tried"]:
            rmse = "–" if t["rmse_m"] is None else f"{t['rmse_m']:.3f} m"
            lines.append(f"{t['interval_m']:>8.1f} m{rmse:>9}{t['pickets']:>9}{t['errors']:>8}")
        why = "σ of a picket" if p["tolerance_m"] is None else "tolerance"
        limit = p["sigma_of_a_picket_m"] if p["tolerance_m"] is None else p["tolerance_m"]
        lines.append(f"pilot: pickets every {p['interval_m']:.1f} m (RMSE = {why}, {limit:.3f} m), k {p['k']:.3f}")
    return lines
