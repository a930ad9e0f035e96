"""What an adjustment writes of rigid rigs: rigs.csv, and the entry `rigs` of adjustment.json."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.formats.results.json_text import number_or_none
from aerotri.results.rigs import MountedCamera

ELEMENTS = ("x", "y", "z", "omega", "phi", "kappa")
SIGMAS = ("sx", "sy", "sz", "s_omega", "s_phi", "s_kappa")
UNITS = np.array([1.0, 1.0, 1.0, *np.degrees(np.ones(3))])
"""Metres, and degrees in a radian."""


def rig_columns(cameras: tuple[MountedCamera, ...]) -> dict[str, np.ndarray]:
    """Columns of rigs.csv, a row a camera."""
    names = {
        name: np.array([getattr(one, name) for one in cameras], dtype=str) for name in ("rig", "reference", "camera")
    }
    values = np.array([_values(one) for one in cameras])
    sigmas = np.array([one.sigma * UNITS for one in cameras])
    return {
        **names,
        **{name: values[:, k] for k, name in enumerate(ELEMENTS)},
        **{name: sigmas[:, k] for k, name in enumerate(SIGMAS)},
        "stations": np.array([one.stations for one in cameras]),
    }


def rigs_json(cameras: tuple[MountedCamera, ...]) -> list[dict[str, Any]]:
    """The entry `rigs` of adjustment.json: as rigs.csv, with the correlations of the six elements."""
    return [
        {"rig": one.rig, "reference": one.reference, "camera": one.camera}
        | {name: number_or_none(value) for name, value in zip(ELEMENTS, _values(one), strict=True)}
        | {name: number_or_none(value) for name, value in zip(SIGMAS, one.sigma * UNITS, strict=True)}
        | {
            "stations": one.stations,
            "correlations": [
                {"element": name} | {other: number_or_none(r) for other, r in zip(ELEMENTS, row, strict=True)}
                for name, row in zip(ELEMENTS, one.correlations, strict=True)
            ],
        }
        for one in cameras
    ]


def _values(one: MountedCamera) -> np.ndarray:
    return np.concatenate([one.position, one.angles]) * UNITS
