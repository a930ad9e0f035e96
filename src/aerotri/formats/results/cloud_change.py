"""Distances of two point clouds for machines: cloud_change.json."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.version import __version__

if TYPE_CHECKING:
    from aerotri.volume.change.adjusted_clouds import AdjustedDistances
    from aerotri.volume.change.clouds import Cloud, CloudDistances, Scales


@dataclass(frozen=True, eq=False)
class CloudSettings:
    """What distances were found with.

    Parameters
    ----------
    spacing, registration : m. stable : (k,) bool, places on stable ground; None where none was given.
    stable_mean : m, mean distance there.
    """

    scales: Scales
    spacing: float
    registration: float
    stable: np.ndarray | None = None
    stable_mean: float = float("nan")


def cloud_change_json(
    found: CloudDistances, clouds: tuple[Cloud, Cloud], adjusted: AdjustedDistances | None, used: CloudSettings,
    source: str,
) -> dict[str, Any]:  # fmt: skip
    """The numbers of cloud_change.json; m.

    Parameters
    ----------
    clouds : both, as used. source : what σ is from.
    """
    known, level = np.isfinite(found.distance), found.level(used.registration)
    beyond, scales = np.abs(found.distance) > level, used.scales
    return {
        "aerotri": __version__, "cylinder_m": scales.cylinder, "normal_m": scales.normal, "reach_m": scales.reach,
        "spacing_m": used.spacing, "points_first": len(clouds[0].xyz), "points_second": len(clouds[1].xyz),
        "core_points": len(found.core), "with_distance": int(known.sum()), "sigma_from": source,
        "adjustments_m": None if adjusted is None else float(np.median(np.sqrt(adjusted.difference[known]))),
        "registration_m": float(used.registration),
        "stable": None if used.stable is None else {
            "core_points": int((used.stable & known).sum()), "mean_m": used.stable_mean,
        },
        "sigma_m": float(np.nanmedian(found.sigma)), "level_of_detection_m": float(np.nanmedian(level)),
        "beyond_level_percent": 100.0 * float(beyond[known].mean()),
        "gained_percent": 100.0 * float((beyond & (found.distance > 0.0))[known].mean()),
        "lost_percent": 100.0 * float((beyond & (found.distance < 0.0))[known].mean()),
        "distance_m": {
            "median": float(np.nanmedian(found.distance)), "smallest": float(np.nanmin(found.distance)),
            "largest": float(np.nanmax(found.distance)),
        },
    }  # fmt: skip
