"""What a flight will give, before it is flown: accuracy of volumes, attitude that they tolerate, interval of points.

>>> from aerotri import predict
>>> flight = predict.volume(height=1500.0, length=9000.0, width=3600.0, bridging=3600.0)
>>> round(flight.sigma_mean_height, 3)
0.086
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from aerotri.conventions import InputError
from aerotri.public.picket_interval import error_pickets, picket_interval
from aerotri.public.table import Table
from aerotri.simulation.designs import SIGMA0_SHARE, VolumeDesign, volume_flight
from aerotri.volume import theory

if TYPE_CHECKING:
    from aerotri.volume.sensitivity import AttitudeTolerance
    from aerotri.volume.theory import Prediction

__all__ = ["VolumeDesign", "attitude", "error_pickets", "picket_interval", "simulated_sigma", "theory", "volume"]

SITE_PLACES, MOST_MODELS = 41, 100_000
"""Places a side of an area that are judged, and models of a block that is adjusted at most; chosen [C]: 41 × 41 show
the edges of strips, and more models than 100 000 are a mistake in the size."""
AREA_SHARE = 0.96
"""Part of the sides of an area that is judged: its middle."""
FEWEST_SEEN = 0.9
"""Part of the places of an area that a simulated flight has to see."""


@dataclass(frozen=True, eq=False, repr=False)
class VolumePrediction:
    """How sure a volume will be.

    Parameters
    ----------
    record : σ by every formula of the theory.
    simulated : m, σ of the mean height by the adjustment of a simulated flight; None where none was asked for.
    """

    record: Prediction
    simulated: float | None = None

    @property
    def sigma_mean_height(self) -> float:
        """m: by the simulated flight where there is one, else by the theory, the strips adjusted as a whole."""
        return self.record.joint if self.simulated is None else self.simulated

    @property
    def sigma_volume(self) -> float:
        """m³, as `sigma_mean_height`."""
        return self.sigma_mean_height * self.record.area

    @property
    def summary(self) -> dict[str, Any]:
        """What the command prints as JSON: counts of models, and σ by every way."""
        p = self.record
        return {
            "models_between_control": p.d, "models_per_strip": p.n, "strips": p.m, "sigma0_m": p.sigma0,
            "area_m2": p.area,
            "predictions": [{"by": by, "sigma_mean_height_m": v, "sigma_volume_m3": v * p.area}
                            for by, v in self._rows()],
        }  # fmt: skip

    @property
    def table(self) -> Table:
        """A row a way to predict it."""
        units = {"sigma_mean_height_m": "m", "sigma_volume_m3": "m³"}
        return Table("σ of the volume", pa.Table.from_pylist(self.summary["predictions"]), units)

    def _rows(self) -> list[tuple[str, float]]:
        p = self.record
        rows = [
            ("span by span (Kubik, repaired)", p.spanwise), ("adjusted as a whole, same error model", p.joint),
            ("without control but in the first model", p.free / float(np.sqrt(p.m))),
        ]  # fmt: skip
        return rows if self.simulated is None else [*rows, ("simulated flight, adjusted", self.simulated)]

    def __repr__(self) -> str:
        return f"<aerotri.VolumePrediction: σ of the mean height {self.sigma_mean_height:.4f} m>"

    def _repr_html_(self) -> str:
        return self.table.html()


def volume(
    height: float,
    length: float,
    width: float,
    bridging: float,
    *,
    sigma0_share: float = SIGMA0_SHARE,
    simulate: bool = False,
    seed: int = 1,
) -> VolumePrediction:
    """The accuracy of a volume: Kubik's theory, repaired, and the adjustment of a simulated flight.

    Parameters
    ----------
    height : m, flying height over the ground.
    length : m, of the area along the strips.
    width : m, of the area across the strips.
    bridging : m, between control points along the strips.
    sigma0_share : σ of a height from one model over the flying height.
    simulate : adjust a simulated flight of this design too.
    seed : of the simulation.

    Returns
    -------
    VolumePrediction

    Raises
    ------
    InputError
        For sizes that are not positive, or an area of too many models.

    Examples
    --------
    >>> found = volume(1500.0, 7200.0, 1800.0, 3600.0)
    >>> found.summary["models_per_strip"]
    8
    """
    from aerotri.volume.theory import BASE_SHARE, predict_volume

    if min(height, length, width, bridging, sigma0_share) <= 0.0:
        raise InputError("sizes have to be positive", "give metres")
    design = VolumeDesign(height, length, width, bridging, sigma0_share)
    if design.models > MOST_MODELS:
        raise InputError(
            f"the area has {design.models:.3g} models, {MOST_MODELS} at most are adjusted",
            "make --length and --width smaller, or --height larger",
        )
    record = predict_volume(height, length, width, bridging, sigma0_share, BASE_SHARE)
    return VolumePrediction(record, simulated_sigma(design, seed) if simulate else None)


def simulated_sigma(design: VolumeDesign, seed: int = 1, pointing: float = 1.0) -> float:
    """m, σ of the mean height of the area through the adjustment of a simulated flight of that design.

    Parameters
    ----------
    pointing : σ of an image point of a control point over that of a tie point.

    Raises
    ------
    InputError
        When the flight does not cover the area.
    """
    from aerotri.pipeline import adjust_keeping_system
    from aerotri.simulation import parse_spec
    from aerotri.simulation import simulate as simulated
    from aerotri.volume.pickets import pickets_where_seen
    from aerotri.volume.response import respond

    block, _ = simulated(parse_spec(volume_flight(design, pointing)), seed)
    calibration = adjust_keeping_system(block)
    xyz = _places((AREA_SHARE * design.length, AREA_SHARE * design.width))
    pickets, seen = pickets_where_seen(calibration, xyz, 1e-3)
    if seen.mean() < FEWEST_SEEN:
        raise InputError("the simulated flight does not cover the area", "give a longer or wider area")
    gradient = np.zeros((len(pickets), 3))
    gradient[:, 2] = 1.0 / len(pickets)
    # the accuracy stated, not that of one sample: σ̂0 of the simulation is taken out
    return float(np.sqrt(respond(calibration, pickets, gradient).variance)) / calibration.result.outcome.sigma0


@dataclass(frozen=True, eq=False, repr=False)
class AttitudePrediction:
    """Which σ of ω, φ, κ the tolerance of a volume allows.

    Parameters
    ----------
    tolerance : m³, 1 σ.
    record : an angle each, seconds of arc; ∞ where any angle is allowed.
    """

    tolerance: float
    record: tuple[AttitudeTolerance, ...]

    @property
    def summary(self) -> dict[str, Any]:
        """What the command prints as JSON; None where any angle is allowed."""
        angles = {t.angle: {f"{k}_arcsec": getattr(t, k) if np.isfinite(getattr(t, k)) else None
                            for k in ("independent", "common", "all_three")} for t in self.record}  # fmt: skip
        return {"tolerance_m3": self.tolerance, "angles": angles}

    @property
    def table(self) -> Table:
        """A row an angle, seconds of arc."""
        rows = [{"angle": angle, **values} for angle, values in self.summary["angles"].items()]
        return Table("σ of the angles", pa.Table.from_pylist(rows), {name: "″" for name in list(rows[0])[1:]})

    def __repr__(self) -> str:
        return f"<aerotri.AttitudePrediction for {self.tolerance:.4g} m³>"

    def _repr_html_(self) -> str:
        return self.table.html()


def attitude(
    tolerance: float,
    thickness: float,
    *,
    height: float = 1500.0,
    base: float = 900.0,
    focal_length: float = 153.0,
    site: tuple[float, float] = (400.0, 400.0),
    offset: tuple[float, float] = (0.0, 0.0),
) -> AttitudePrediction:
    """Which σ of ω, φ, κ the tolerance of a volume allows, in a vertical model.

    Parameters
    ----------
    tolerance : of the volume, per cent, 1 σ.
    thickness : m, mean thickness of the volume.
    height : m, flying height over the ground.
    base : m, between the photographs.
    focal_length : mm.
    site : m, size along and across the base.
    offset : m, of the site from the middle of the base, along and across it.

    Returns
    -------
    AttitudePrediction
        Seconds of arc.

    Raises
    ------
    InputError
        For sizes that are not positive.

    Examples
    --------
    >>> found = attitude(1.0, 5.0)
    >>> found.tolerance
    8000.0
    >>> round(found.summary["angles"]["phi"]["independent_arcsec"], 2)
    2.66
    """
    from aerotri.volume.sensitivity import SECOND, attitude_tolerance, vertical_pair

    if min(height, base, focal_length, *site, thickness, tolerance) <= 0.0:
        raise InputError("sizes have to be positive", "give metres and millimetres")
    places, area = _places(site, offset), site[0] * site[1]
    limit = tolerance / 100.0 * area * thickness
    found = attitude_tolerance(
        vertical_pair(height, base, focal_length), places, np.full(len(places), area / len(places)), limit
    )
    rows = [replace(t, **{k: getattr(t, k) / SECOND for k in ("independent", "common", "all_three")}) for t in found]
    return AttitudePrediction(limit, tuple(rows))


def _places(size: tuple[float, float], middle: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """(n, 3) m, places evenly over a rectangle at height 0."""
    steps = 0.5 * np.linspace(-1.0, 1.0, SITE_PLACES)
    x, y = np.meshgrid(*(m + s * steps for m, s in zip(middle, size, strict=True)))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
