"""What an adjustment says of rolling shutters: readout times, motions of photographs, whether they are needed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

NEEDED, NOT_NEEDED, NOT_TOLD_APART = "needed", "not needed", "not told apart"
SHARED_ERRORS = "within shared errors"


@dataclass(frozen=True)
class Readout:
    """The readout time of one camera.

    Parameters
    ----------
    readout_ms, sigma_ms : its value and σ, 0 where it is held. status : 'estimated', 'weighted' or 'fixed'.
    photographs : of the camera. speed_m_s : median over them. moved_m : median way during the readout.
    velocities : how many photographs have their velocity from where, see `adjustment.track_velocity`.
    total_sigma_ms : with the model part, see `statistics.model_part`; σ itself where there is none.
    time_rounding_s : what the times of its photographs are rounded to, 1 for whole seconds; 0 where they are finer.
    """

    camera: str
    readout_ms: float
    sigma_ms: float
    status: str
    row_direction: str
    photographs: int
    speed_m_s: float
    moved_m: float
    velocities: dict[str, int] = field(default_factory=dict)
    total_sigma_ms: float = 0.0
    time_rounding_s: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """As adjustment.json has it."""
        return dict(self.__dict__)

    @property
    def sentence(self) -> str:
        """What a user is told."""
        value = f"{self.readout_ms:.4g} ms"
        value += " (held)" if self.status == "fixed" else f" ± {self.sigma_ms:.2g} ms"
        if self.total_sigma_ms > self.sigma_ms:
            value += f" (total σ {self.total_sigma_ms:.2g} ms)"
        return (
            f"the readout time of camera '{self.camera}' is {value}: at {self.speed_m_s:.2g} m/s it moves by "
            f"{abs(self.moved_m):.2g} m while a photograph is read{self._about_times}"
        )

    @property
    def _about_times(self) -> str:
        if not self.time_rounding_s:
            return ""
        return (
            ". The times of its photographs are whole seconds: velocities are means over several of them, and how far "
            "they err is not in σ. Give times with fractions of a second where the camera or its log has them "
            "(column time of gnss_ins.csv)"
        )


@dataclass(frozen=True, eq=False)
class Motions:
    """How n photographs of rolling shutters moved while they were read.

    Parameters
    ----------
    image : (n,) row of the block. velocity : (n, 3) m/s in the axes of the adjustment. spin : (n, 3) rad/s, camera
        frame. source : (n,) str, where the velocity comes from.
    """

    image: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    source: np.ndarray


@dataclass(frozen=True)
class Variant:
    """The block with another model of the effect.

    Parameters
    ----------
    name : 'none', 'affinity', 'rolling shutter' or 'both'. status : 'converged', or why there is nothing behind it.
    sigma0 : σ̂0. bic : of the image points, smaller is better. readout_t : the largest |T|/σ; NaN without readout time.
    control_rms, check_rms : X, Y, Z, m, at control points predicted without themselves and at check points.
    """

    name: str
    status: str
    sigma0: float
    bic: float
    readout_t: float
    control_rms: tuple[float, float, float]
    check_rms: tuple[float, float, float]

    def as_dict(self) -> dict[str, Any]:
        """As adjustment.json has it, NaN as null."""

        def plain(value: float) -> float | None:
            return value if value == value else None

        axes = "XYZ"
        return {
            "name": self.name,
            "status": self.status,
            "sigma0": plain(self.sigma0),
            "bic": plain(self.bic),
            "readout_t": plain(self.readout_t),
            "control_rms": {axis: plain(v) for axis, v in zip(axes, self.control_rms, strict=True)},
            "check_rms": {axis: plain(v) for axis, v in zip(axes, self.check_rms, strict=True)},
        }


@dataclass(frozen=True)
class ShutterTest:
    """Whether the block needs a rolling shutter: without it, with an affinity of the camera instead, with both.

    Parameters
    ----------
    verdict : `NEEDED`, `NOT_NEEDED`, `NOT_TOLD_APART` or `SHARED_ERRORS`.
    height_change_m : root mean square change of heights by the rolling shutter, after a tilted plane is taken off.
    height_sigma_m : median σ of heights.
    gain, gain_error : how much smaller errors at control predicted without itself and at check points are than without
        a rolling shutter, 1 − ratio, and its standard error; NaN where there are too few.
    total_t : |T| over its total σ, which knows errors that groups of photographs share.
    """

    verdict: str
    variants: tuple[Variant, ...]
    height_change_m: float
    height_sigma_m: float
    gain: float
    gain_error: float
    total_t: float = float("nan")

    @property
    def bends_heights(self) -> bool:
        """Whether heights change shape by more than their σ although nothing speaks for it."""
        worse = self.gain < -self.gain_error
        return (self.verdict != NEEDED or worse) and self.height_change_m > self.height_sigma_m

    def as_dict(self) -> dict[str, Any]:
        """As adjustment.json has it."""
        known = self.gain == self.gain
        return {
            "verdict": self.verdict,
            "bends_heights": self.bends_heights,
            "height_change_m": self.height_change_m,
            "height_sigma_m": self.height_sigma_m,
            "total_t": self.total_t if self.total_t == self.total_t else None,
            "gain": self.gain if known else None,
            "gain_error": self.gain_error if known else None,
            "variants": [one.as_dict() for one in self.variants],
        }

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        said = {
            NEEDED: "the image points need the rolling shutter: affinity and shear of the camera do not explain them "
            "as well",
            NOT_NEEDED: "the rolling shutter is not needed: the readout time is zero within its σ",
            SHARED_ERRORS: "the readout time cannot be told from other errors that photographs share: it is zero "
            "within its total σ",
            NOT_TOLD_APART: "the readout time cannot be told from an affinity and shear of the camera (b1, b2 of "
            "brown), which explain the image points as well; strips across and a known readout time tell them apart",
        }[self.verdict]
        if not self.bends_heights:
            return said
        return (
            f"{said}. It bends heights: they change by {self.height_change_m:.2g} m (RMS) beside a plane, their σ is "
            f"{self.height_sigma_m:.2g} m. Hold the readout time at a known value, or leave it out"
        )


@dataclass(frozen=True, eq=False)
class RollingShutters:
    """All that is said of the rolling shutters of a block. test : None where there was none."""

    readouts: tuple[Readout, ...]
    motions: Motions
    test: ShutterTest | None = None

    def as_dict(self) -> dict[str, Any]:
        """As adjustment.json has it."""
        return {
            "cameras": [one.as_dict() for one in self.readouts],
            "test": None if self.test is None else self.test.as_dict(),
        }
