"""`aerotri predict`: the accuracy of a volume before the flight, and the attitude accuracy that a volume tolerates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aerotri.formats.results.json_text import json_text

if TYPE_CHECKING:
    from aerotri.simulation.designs import VolumeDesign


def run_predict_volume(design: VolumeDesign, simulate: bool, seed: int, as_json: bool) -> None:
    """Print σ of the mean height and of the volume by the theory, and by the adjustment of a simulated flight."""
    from aerotri.public import predict

    d = design
    found = predict.volume(
        d.height, d.length, d.width, d.bridging, sigma0_share=d.sigma0_share, simulate=simulate, seed=seed
    )
    if as_json:
        print(json_text(found.summary))
        return
    p = found.record
    print(f"{p.m} strips of {p.n} models, control every {p.d} models, σ of a height from one model {p.sigma0:.3f} m")
    for row in found.summary["predictions"]:
        mean, volume = row["sigma_mean_height_m"], row["sigma_volume_m3"]
        print(f"  {row['by']:<40} σ of the mean height {mean:.4f} m, of the volume {volume:.4g} m³")


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
    from aerotri.public import predict

    d = design
    found = predict.attitude(
        d.tolerance_percent, d.thickness, height=d.height, base=d.base, focal_length=d.focal_length_mm, site=d.site,
        offset=d.offset,
    )  # fmt: skip
    if as_json:
        print(json_text(found.summary))
        return
    print(f"a tolerance of {d.tolerance_percent:g} % is {found.tolerance:.4g} m³ (1 σ); it allows, in seconds of arc:")
    for t in found.record:
        own, common = (f"{v:10.1f}" if np.isfinite(v) else "       any" for v in (t.independent, t.common))
        print(f"  {t.angle:<6} alone: each photograph its own {own}, common to both {common}")
    print(f"  all three angles alike, each photograph its own: {found.record[0].all_three:.1f}")
