"""A volume for machines: volume.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import in_digits
from aerotri.version import __version__
from aerotri.volume.accuracy import StatedSigma, VolumeSigma
from aerotri.volume.bases import Base, PlaneBase
from aerotri.volume.boundary import Boundary
from aerotri.volume.compute import Volumes
from aerotri.volume.piles import Pile
from aerotri.volume.quantity import Volume
from aerotri.volume.settings import Density

SYSTEMATIC = "change of the volume by image errors, wrong − true, were the photographs used uncorrected"

STATED = "what is stated about base and boundary alone; the errors of the surface are not in it"
NO_SIGMA = "no σ: give --adjustment RESULT, the adjustment that the surface was measured with"
BEYOND = "what it is expected to hold beyond that of the surface as given; not in it, counted in its σ"
CURVATURE = "terrain between the measured points (estimated, not added); its error is part of σ as interpolation"


@dataclass(frozen=True)
class Sources:
    """Where a volume comes from, as the user named it."""

    dtm: str
    crs: str
    adjustment: str = ""
    pickets: str = ""


def volume_json(
    volumes: Volumes, base: Base, boundary: Boundary, sources: Sources, sigma: VolumeSigma | None,
    density: Density | None = None, stated: StatedSigma | None = None,
) -> dict[str, Any]:  # fmt: skip
    """The content of volume.json; m, m², m³.

    Parameters
    ----------
    stated : instead of σ, where there is no adjustment.
    """
    v, s = volumes.chosen, volumes.sections
    in_words = _stated_in_words(v, stated, density) if sigma is None else [*sigma.notes]
    warnings = [*volumes.warnings, *(in_words or [NO_SIGMA] if sigma is None else in_words)]
    return {
        "aerotri": __version__, "dtm": sources.dtm, "crs": sources.crs,
        "base": _base(base),
        "boundary": {"name": boundary.name, "polygon": boundary.polygon_name, "area_m2": boundary.area},
        "method": v.method, **_numbers(v),
        "mean_thickness_m": v.net / v.area,
        "lowest_m": _finite(volumes.lowest), "highest_m": _finite(volumes.highest),
        "methods": [{"method": one.method, **_numbers(one), "note": one.note} for one in volumes.by_method],
        "sections": {"spacing_m": s.spacing, "azimuth_deg": s.azimuth, "count": len(s.station)},
        "sigma": None if sigma is None else _sigma(sigma, v, sources), "stated_sigma": _stated(stated),
        "mass": _mass(v, sigma, density, stated), "warnings": warnings,
    }  # fmt: skip


def boundary_in_words(content: Mapping[str, Any]) -> str:
    """Its file or text, and the name of its polygon where it has one of its own; `content` as in volume.json."""
    name, own = str(content["name"]), str(content.get("polygon", ""))
    return name if not own or own.lower() == Path(name).stem.lower() else f"{name}, polygon '{own}'"


def pile_json(
    pile: Pile, sigma: VolumeSigma | None, density: Density | None, stated: StatedSigma | None = None
) -> dict[str, Any]:
    """A pile of volume.json: its volume, σ with its parts, tonnes."""
    v = pile.volumes.chosen
    return {
        "name": pile.name, "area_m2": pile.boundary.area, "base": pile.base.name, **_numbers(v),
        "sigma_m3": None if sigma is None else sigma.total, **sides_json(sigma),
        "parts_m3": None if sigma is None else dict(sigma.parts),
        "stated_sigma_m3": _total_stated(stated), "mass": _mass(v, sigma, density, stated),
    }  # fmt: skip


def sides_json(sigma: VolumeSigma | None) -> dict[str, float | None]:
    """σ of cut and of fill, m³; None where not known."""
    sides = (None, None) if sigma is None or sigma.sides is None else sigma.sides
    return {
        f"sigma_{name}_m3": None if one is None else one.total for name, one in zip(("cut", "fill"), sides, strict=True)
    }


def _sides_with_parts(sigma: VolumeSigma) -> dict[str, Any]:
    """σ of cut and of fill with its parts."""
    if sigma.sides is None:
        return {"cut": None, "fill": None}
    return {
        name: {
            "sigma_m3": one.total,
            "parts_m3": dict(one.parts),
            "beyond": {"meaning": BEYOND, "value_m3": one.beyond},
        }
        for name, one in zip(("cut", "fill"), sigma.sides, strict=True)
    }


def sigma_of_side(content: Mapping[str, Any], name: str) -> float | None:
    """m³, σ of the 'cut' or the 'fill' of volume.json; None where not known, as in files of earlier versions."""
    sigma: Mapping[str, Any] = content.get("sigma") or {}
    return (sigma.get(name) or {}).get("sigma_m3")


def beyond_of_side(content: Mapping[str, Any], name: str) -> float | None:
    """m³ that the 'cut' or the 'fill' is expected to hold beyond what the surface shows; None where the base does not
    cut it, or where it is not known."""
    side = (content.get("sigma") or {}).get(name)
    cuts = content["cut_m3"] > 0.0 and content["fill_m3"] > 0.0
    return side["beyond"]["value_m3"] if side and cuts else None


def _total_stated(stated: StatedSigma | None) -> float | None:
    """m³; None where nothing is stated."""
    return None if stated is None or stated.total <= 0.0 else stated.total


def _stated(stated: StatedSigma | None) -> dict[str, Any] | None:
    total = _total_stated(stated)
    if stated is None or total is None:
        return None
    return {"meaning": STATED, "sigma_m3": total, "parts_m3": {"base": stated.base, "boundary": stated.boundary}}


def _stated_tonnes(v: Volume, stated: StatedSigma | None, density: Density | None) -> float | None:
    """t, σ of the net tonnes by what is stated alone; None where nothing is."""
    if stated is None or density is None:
        return None
    return density.tonnes_sigma(v.net, stated.total) or None


def _stated_in_words(v: Volume, stated: StatedSigma | None, density: Density | None) -> list[str]:
    total, tonnes = _total_stated(stated), _stated_tonnes(v, stated, density)
    parts = [] if stated is None or total is None else [
        f"{in_digits(total, 3)} m³ (base {in_digits(stated.base, 3)} m³, boundary {in_digits(stated.boundary, 3)} m³)"
    ]  # fmt: skip
    parts += [] if tonnes is None else [f"{in_digits(tonnes, 3)} t of mass"]
    if not parts:
        return []
    return [
        f"σ of what is stated alone: {', '.join(parts)}; the errors of the surface are not in it (nor a σ band of its "
        "file): give the adjustment that it was measured with"
    ]


def _mass(
    v: Volume, sigma: VolumeSigma | None, density: Density | None, stated: StatedSigma | None
) -> dict[str, Any] | None:
    if density is None:
        return None
    return {
        "density_t_per_m3": density.t_per_m3, "s_density_t_per_m3": density.sigma, "cut_t": density.tonnes(v.cut),
        "fill_t": density.tonnes(v.fill), "net_t": density.tonnes(v.net),
        "sigma_t": None if sigma is None else density.tonnes_sigma(v.net, sigma.total),
        "stated_sigma_t": _stated_tonnes(v, stated, density),
    }  # fmt: skip


def _numbers(v: Volume) -> dict[str, float]:
    return {
        "cut_m3": v.cut, "fill_m3": v.fill, "net_m3": v.net, "cut_area_m2": v.cut_area, "fill_area_m2": v.fill_area,
        "no_data_area_m2": v.no_data_area,
    }  # fmt: skip


def _base(base: Base) -> dict[str, Any]:
    content: dict[str, Any] = {"name": base.name}
    if isinstance(base, PlaneBase):
        content |= {"z0_m": base.z0, "x0_m": base.x0, "y0_m": base.y0, "slope_x": base.slope_x,
                    "slope_y": base.slope_y}  # fmt: skip
    return content


def _sigma(sigma: VolumeSigma, volume: Volume, sources: Sources) -> dict[str, Any]:
    return {
        "sigma_m3": sigma.total,
        "sigma_mean_height_m": sigma.total / volume.area,
        "parts_m3": dict(sigma.parts), **_sides_with_parts(sigma),
        "curvature": None if sigma.curvature is None else {
            "meaning": CURVATURE, "in_the_volume": False, "value_m3": sigma.curvature[0],
            "sigma_m3": sigma.curvature[1],
        },
        "systematic": {
            "meaning": SYSTEMATIC, "in_the_volume": not sigma.corrected,
            "variants": [{"variant": s.variant, "value_m3": s.value, "sigma_m3": s.sigma} for s in sigma.systematic],
        },
        "pickets": sigma.pickets, "rays": sigma.rays, "adjustment": sources.adjustment,
        "picket_file": sources.pickets,
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
