"""The blocks of section 6 of paper 003 (Spreckels, Schlienkamp, Jacobsen 2007), simulated smaller, and its figures.

[P] cameras, scales, end laps, parameters, contour intervals. [C] what the cameras do wrong comes from physics (CCDs and
heads shifted, turned, scaled and stitched, lenses, film), its size from the averaged residuals the paper shows: some
micrometres, the UltraCamD three times the DMC. So form and order of the deformation can be compared, not its lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Picture:
    """A figure of the paper: its number, end lap, h/b and contour interval in cm as printed, None where it has none."""

    number: int
    end_lap: float
    h_over_b: float | None = None
    interval_cm: float | None = None


@dataclass(frozen=True)
class Case:
    """A camera, its block, the sets of parameters (heading, parameters) and the figures made of them."""

    key: str
    title: str
    plan: dict[str, Any]
    sets: tuple[tuple[str, str], ...]
    pictures: tuple[Picture, ...]


def cases() -> tuple[Case, ...]:
    """UltraCamD of DSK-Saar, DMC and RMK TOP 15 of Frederiksstad."""
    return (
        Case(
            "ultracam_d",
            "UltraCamD, DSK-Saar",
            _plan("ultracam_d", 4.0, 1019.0, end_lap=0.8315, side_lap=0.4, strips=4, images_per_strip=19),
            (("1–12", "bluh:1-12"), ("1–12, 42–73", "bluh:1-12,ultracam_d:42-73")),
            (Picture(16, 0.663, 4.4, 5.0), Picture(17, 0.495, 2.9, 5.0), Picture(18, 0.84, 9.3, 10.0)),
        ),
        Case(
            "dmc",
            "DMC, Frederiksstad",
            _plan("dmc", 4.0 / 3.0, 919.9, end_lap=0.63, side_lap=0.6, strips=6, images_per_strip=16),
            (("1–12", "bluh:1-12"), ("1–12, 30–41, 74–77", "bluh:1-12,dmc:30-41+74-77")),
            (Picture(19, 0.63, None, 5.0),),
        ),
        Case(
            "rmk_top_15",
            "RMK TOP 15, Frederiksstad",
            _plan("rmk_top_15", 4.0, 1620.0, end_lap=0.61, side_lap=0.6, strips=5, images_per_strip=10),
            (("1–12", "bluh:1-12"),),
            (Picture(20, 0.61),),
        ),
    )


def _plan(preset: str, rms_um: float, height_m: float, **flight: Any) -> dict[str, Any]:
    return {
        "name": preset,
        "camera": {preset: {"preset": preset, "errors": {"physical": {"rms_um": rms_um, "seed": 2}}}},
        "flight": {
            "height_m": height_m,
            "heading_deg": 90.0,
            "cross_strips": [{"position": 0.5}],
            "attitude_sigma_deg": [1.0, 1.0, 2.0],
            "position_sigma_m": [5.0, 5.0, 3.0],
            **flight,
        },
        "terrain": {"kind": "undulating", "height_m": 200.0, "relief_rms_m": 20.0, "wavelength_m": 900.0},
        "tie_points": {"per_image": 130, "probability": 0.5, "sigma_um": 2.0},
        "control": {"distance_bases": 4.0, "base_end_lap": 0.6, "sigma_m": [0.03, 0.03, 0.03], "check_points": 0},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
    }
