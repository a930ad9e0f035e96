"""A change for machines: change.json."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, log10
from typing import Any

import numpy as np

from aerotri.version import __version__
from aerotri.volume.change.compute import LEVEL, Change, ChangedVolume

VOLUMES = ("gained", "lost", "net")


def change_json(
    change: Change, names: tuple[str, str], crs: str, stable: str, how: str, notes: tuple[str, ...]
) -> dict[str, Any]:
    """The content of change.json; m, m², m³."""
    c, a = change, change.alignment
    known = np.isfinite(c.difference)
    of_cells = c.sigma[known]
    return {
        "aerotri": __version__, "first": names[0], "second": names[1], "crs": crs, "cell_m": c.grid.cell_x,
        "cells": int(known.sum()), "level_of_detection_sigma": LEVEL,
        "level_of_detection_m": float(LEVEL * np.median(of_cells)) if len(of_cells) else None,
        "beyond_level_percent": 100.0 * c.beyond,
        "sigma_m": float(np.median(of_cells)) if len(of_cells) else None,
        "noise_length_m": float(np.sqrt(c.sharing * c.grid.cell_x * c.grid.cell_y)),
        "alignment": None if not stable else {
            "how": how, "stable": stable, "cells": a.cells, "cells_used": a.used,
            "noise_factor": float(a.factor) if np.isfinite(a.factor) else None,
            "unknowns": [
                {"name": name, "value": float(value), "sigma": float(sigma)}
                for name, value, sigma in zip(a.names, a.values, c.moved_sigma, strict=True)
            ],
        },
        "volumes": [_volume(one) for one in c.volumes], "warnings": list(notes),
    }  # fmt: skip


def at_most(volume: Mapping[str, Any], of: str) -> float | None:
    """m³ that what was gained or lost stays below, where it is nothing beside σ of net; None where it counts.

    A few cells beyond the level of detection make a number with many digits that says nothing.
    """
    least = NOTHING_OF_NET * volume["sigma_net_m3"]
    if of == "net" or not 0.0 < abs(volume[f"{of}_m3"]) + volume[f"sigma_{of}_m3"] < least:
        return None
    return float(f"{10.0 ** ceil(log10(least)):.1g}")


NOTHING_OF_NET = 0.01
"""Of σ of the net volume, below which a part of it is nothing; chosen [C]: two digits of σ do not show it."""


def _volume(v: ChangedVolume) -> dict[str, Any]:
    content: dict[str, Any] = {"name": v.name, "area_m2": v.area, "no_data_area_m2": v.no_data_area,
                               "gained_area_m2": v.gained_area, "lost_area_m2": v.lost_area}  # fmt: skip
    for of in VOLUMES:
        content |= {f"{of}_m3": getattr(v, of), f"sigma_{of}_m3": v.sigma(of), f"parts_{of}_m3": dict(v.parts[of])}
    return content
