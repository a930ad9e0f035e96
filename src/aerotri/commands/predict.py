"""`aerotri predict`: the accuracy of a volume before the flight, and the attitude accuracy that a volume tolerates."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aerotri.conventions import InputError

FILM_MM, FOCAL_MM = 230.0, 153.0
"""The wide-angle film camera of the theory, 60 % end lap."""
SITE_PLACES, MOST_MODELS = 41, 100_000


@dataclass(frozen=True)
class VolumeDesign:
    """A flight over an area, m; shares of the flying height; film format and principal distance are wide angle."""

    height: float
    length: float
    width: float
    bridging: float
    sigma0_share: float = 2e-4

    @property
    def base(self) -> float:
        """m, 60 % end lap of the format."""
        return 0.4 * FILM_MM / FOCAL_MM * self.height


def run_predict_volume(design: VolumeDesign, simulate: bool, seed: int, as_json: bool) -> None:
    """Print σ of the mean height and of the volume by the theory, and by the adjustment of a simulated flight."""
    from aerotri.volume.theory import BASE_SHARE, predict_volume

    if min(design.height, design.length, design.width, design.bridging, design.sigma0_share) <= 0.0:
        raise InputError("sizes have to be positive", "give metres")
    models = (design.length / design.base + 1.0) * (design.width / (2.0 * design.base) + 1.0)
    if models > MOST_MODELS:
        raise InputError(
            f"the area has {models:.3g} models, {MOST_MODELS} at most are adjusted",
            "make --length and --width smaller, or --height larger",
        )
    p = predict_volume(design.height, design.length, design.width, design.bridging, design.sigma0_share, BASE_SHARE)
    rows = [
        ("span by span (Kubik, repaired)", p.spanwise), ("adjusted as a whole, same error model", p.joint),
        ("without control but in the first model", p.free / float(np.sqrt(p.m))),
    ]  # fmt: skip
    if simulate:
        rows.append(("simulated flight, adjusted", simulated_sigma(design, seed)))
    content: dict[str, Any] = {
        "models_between_control": p.d, "models_per_strip": p.n, "strips": p.m, "sigma0_m": p.sigma0,
        "area_m2": p.area,
        "predictions": [{"by": by, "sigma_mean_height_m": v, "sigma_volume_m3": v * p.area} for by, v in rows],
    }  # fmt: skip
    if as_json:
        print(json.dumps(content, indent=2, ensure_ascii=False))
        return
    print(f"{p.m} strips of {p.n} models, control every {p.d} models, σ of a height from one model {p.sigma0:.3f} m")
    for by, v in rows:
        print(f"  {by:<40} σ of the mean height {v:.4f} m, of the volume {v * p.area:.4g} m³")


def simulated_sigma(design: VolumeDesign, seed: int = 1, pointing: float = 1.0) -> float:
    """m, σ of the mean height of the area through the adjustment of a simulated flight of that design.

    The image σ is the one that gives σ0 to a height from one model: σ0 = √2·(H/B)·(H/c)·σ.

    Parameters
    ----------
    pointing : σ of an image point of a control point over that of a tie point.
    """
    from aerotri.pipeline import adjust_keeping_system
    from aerotri.simulation import parse_spec
    from aerotri.simulation import simulate as simulated
    from aerotri.volume.pickets import pickets_where_seen
    from aerotri.volume.response import respond

    block, _ = simulated(parse_spec(flight_spec(design, pointing)), seed)
    calibration = adjust_keeping_system(block)
    x, y = np.meshgrid(design.length * _places(), design.width * _places())
    xyz = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    pickets, seen = pickets_where_seen(calibration, xyz, 1e-3)
    if seen.mean() < 0.9:
        raise InputError("the simulated flight does not cover the area", "give a longer or wider area")
    gradient = np.zeros((len(pickets), 3))
    gradient[:, 2] = 1.0 / len(pickets)
    # the accuracy stated, not that of one sample: σ̂0 of the simulation is taken out
    return float(np.sqrt(respond(calibration, pickets, gradient).variance)) / calibration.result.outcome.sigma0


def flight_spec(design: VolumeDesign, pointing: float = 1.0) -> dict[str, Any]:
    """The spec of a simulated flight: strips along X as the theory has them, in every strip two control points at the
    distance that is bridged."""
    base, sigma0 = design.base, design.sigma0_share * design.height
    sigma_um = 1e3 * sigma0 / (np.sqrt(2.0) * design.height / base * design.height / FOCAL_MM)
    strips = max(1, round(design.width / (2.0 * base)))
    images = max(2, round(design.length / base) + 1)
    return {
        "name": "design",
        "camera": {"film": {"model": "frame", "size_px": [11500, 11500], "pixel_um": 20.0,
                            "focal_length_mm": FOCAL_MM, "flight_axis": "+x"}},
        "flight": {"height_m": design.height, "strips": strips, "images_per_strip": images, "end_lap": 0.6,
                   "side_lap": 0.2, "heading_deg": 90.0, "attitude_sigma_deg": [0.5, 0.5, 0.5]},
        "terrain": {"kind": "flat", "height_m": 0.0},
        "tie_points": {"per_image": 15.0, "distribution": "nodes", "pattern": [3, 3], "sigma_um": sigma_um},
        "control": {"positions": _control(images - 1, round(design.bridging / base), strips),
                    "sigma_m": [0.001, 0.001, 0.001], "image_sigma_um": pointing * sigma_um},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.02},
    }  # fmt: skip


def _control(models: int, bridged: int, strips: int) -> list[list[float]]:
    """Places (along, across) in shares of the block."""
    along = [min(k / models, 1.0) for k in range(0, models + 1, max(bridged, 1))]
    across = [(strip + 0.5 + side) / strips for strip in range(strips) for side in (-0.4, 0.4)]
    return [[a, c] for a in along for c in across]


def _places() -> np.ndarray:
    """Evenly spaced over the middle 96 % of −½ … ½."""
    return 0.48 * np.linspace(-1.0, 1.0, SITE_PLACES)


@dataclass(frozen=True)
class AttitudeDesign:
    """A site in a vertical model: m, mm; tolerance in per cent of the volume, thickness the mean one."""

    height: float
    base: float
    focal_length_mm: float
    site: tuple[float, float]
    offset: tuple[float, float]
    thickness: float
    tolerance_percent: float


def run_predict_attitude(design: AttitudeDesign, as_json: bool) -> None:
    """Print which σ of ω, φ, κ the tolerance of a volume allows."""
    from aerotri.volume.sensitivity import SECOND, attitude_tolerance, vertical_pair

    if min(design.height, design.base, design.focal_length_mm, *design.site, design.thickness) <= 0.0:
        raise InputError("sizes have to be positive", "give metres and millimetres")
    x, y = np.meshgrid(*(o + s * _places() / 0.96 for o, s in zip(design.offset, design.site, strict=True)))
    places = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    area = design.site[0] * design.site[1]
    tolerance = design.tolerance_percent / 100.0 * area * design.thickness
    pair = vertical_pair(design.height, design.base, design.focal_length_mm)
    found = attitude_tolerance(pair, places, np.full(x.size, area / x.size), tolerance)
    rows = [replace(t, **{k: getattr(t, k) / SECOND for k in ("independent", "common", "all_three")}) for t in found]
    if as_json:
        angles = {t.angle: {f"{k}_arcsec": getattr(t, k) if np.isfinite(getattr(t, k)) else None
                            for k in ("independent", "common", "all_three")} for t in rows}  # fmt: skip
        print(json.dumps({"tolerance_m3": tolerance, "angles": angles}, indent=2, ensure_ascii=False))
        return
    print(f"a tolerance of {design.tolerance_percent:g} % is {tolerance:.4g} m³ (1 σ); it allows, in seconds of arc:")
    for t in rows:
        own, common = (f"{v:10.1f}" if np.isfinite(v) else "       any" for v in (t.independent, t.common))
        print(f"  {t.angle:<6} alone: each photograph its own {own}, common to both {common}")
    print(f"  all three angles alike, each photograph its own: {rows[0].all_three:.1f}")
