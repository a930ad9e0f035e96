"""What an adjustment writes of rigid rigs: rigs.csv, and the entry `rigs` of adjustment.json."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.diagnosis.rigidity import camera_verdicts
from aerotri.formats.results.json_text import number_or_none
from aerotri.results.rigidity import ROTATION, HeadTest, Rigidity
from aerotri.results.rigs import MountedCamera, RigMovements

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


def station_columns(rigidity: Rigidity, names: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of rig_stations.csv, a row a photograph.

    Parameters
    ----------
    names : of all photographs of the block.
    """
    tests, whole = rigidity.stations, rigidity.whole
    place = {key: k for k, key in enumerate(zip(whole.rig.tolist(), whole.station.tolist(), strict=True))}
    at = np.array([place.get(key, -1) for key in zip(tests.rig.tolist(), tests.station.tolist(), strict=True)], int)

    def of_station(values: np.ndarray, alone: float) -> np.ndarray:
        return np.append(values, alone)[at]

    turned, sigma = np.degrees(tests.turned), np.degrees(tests.sigma)
    return {
        "image": names[tests.image],
        "station": tests.station.astype(str),
        "rig": tests.rig.astype(str),
        "camera": tests.camera.astype(str),
        **{f"turned_{axis}": turned[:, k] for k, axis in enumerate("xyz")},
        **{f"s_turned_{axis}": sigma[:, k] for k, axis in enumerate("xyz")},
        "freedom": tests.freedom,
        "f": tests.f,
        "p": tests.p,
        "found": tests.found,
        "station_freedom": of_station(whole.freedom, 0),
        "station_f": of_station(whole.f, np.nan),
        "station_p": of_station(whole.p, 1.0),
        "station_found": of_station(whole.found, False),
    }


def movement_columns(movements: RigMovements, names: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of rig_movements.csv, a row a photograph.

    Parameters
    ----------
    names : of all photographs of the block.
    """
    value, sigma = movements.deviation * UNITS, movements.deviation_sigma * UNITS
    letters = [f"{what}_{axis}" for what in ("moved", "turned") for axis in "xyz"]
    return {
        "image": names[movements.image],
        "station": movements.station.astype(str),
        "rig": movements.rig[movements.of].astype(str),
        "camera": movements.camera[movements.of].astype(str),
        **{name: value[:, k] for k, name in enumerate(letters)},
        **{f"s_{name}": sigma[:, k] for k, name in enumerate(letters)},
    }


def movements_json(movements: RigMovements) -> list[dict[str, Any]]:
    """The entry `rig_movements` of adjustment.json."""
    out = []
    for k in range(len(movements.camera)):
        (position, rotation), (of_position, of_rotation) = movements.sigma[k], movements.sigma_sigma[k]
        estimated = (False, False) if movements.estimated is None else movements.estimated[k].tolist()
        out.append({
            "rig": str(movements.rig[k]),
            "camera": str(movements.camera[k]),
            "photographs": int(np.sum(movements.of == k)),
            "movement_m": number_or_none(float(position)),
            "s_movement_m": number_or_none(float(of_position)),
            "movement_m_estimated": estimated[0],
            "movement_deg": number_or_none(float(np.degrees(rotation))),
            "s_movement_deg": number_or_none(float(np.degrees(of_rotation))),
            "movement_deg_estimated": estimated[1],
        })  # fmt: skip
    return out


def rigidity_json(tests: Rigidity) -> dict[str, Any]:
    """The entry `rigidity` of adjustment.json."""
    s = tests.stations
    return {
        "alpha": tests.alpha,
        "power": tests.power,
        "stations": len(tests.whole),
        "stations_found": int(np.sum(tests.whole.found)),
        "cameras": [
            {
                "rig": one.rig,
                "camera": one.camera,
                "keeps_place": one.keeps,
                "says": one.says,
                "photographs_found": int(np.sum(s.found & (s.rig == one.rig) & (s.camera == one.camera))),
                "photograph_detectable_deg": number_or_none(
                    float(np.degrees(tests.station_detectable[one.rig, one.camera]))
                ),
                "tests": [_head_test(test) for test in tests.heads if (test.rig, test.camera) == (one.rig, one.camera)],
            }
            for one in camera_verdicts(tests)
        ],
    }


def _head_test(one: HeadTest) -> dict[str, Any]:
    unit = float(np.degrees(1.0)) if one.what == ROTATION else 1.0
    return {
        "what": one.what,
        "stations": one.stations,
        "movement": number_or_none(one.movement * unit),
        "movement_sigma": number_or_none(one.movement_sigma * unit),
        "movement_p": number_or_none(one.movement_p),
        "movement_found": one.movement_found,
        "movement_detectable": number_or_none(one.movement_detectable * unit),
        **{f"drift_{axis}": number_or_none(v * unit) for axis, v in zip("xyz", one.drift, strict=True)},
        **{f"s_drift_{axis}": number_or_none(v * unit) for axis, v in zip("xyz", one.drift_sigma, strict=True)},
        "drift_p": number_or_none(one.drift_p),
        "drift_found": one.drift_found,
        "drift_detectable": number_or_none(one.drift_detectable * unit),
    }


def _values(one: MountedCamera) -> np.ndarray:
    return np.concatenate([one.position, one.angles]) * UNITS
