"""Cameras of a spec: as the block states them, and as they are."""

from __future__ import annotations

import numpy as np

from aerotri.functional_model.additional_parameters import lens as forward_lens
from aerotri.observations import Camera, Prior, RollingShutter
from aerotri.observations.rolling_shutter import READING
from aerotri.simulation.camera_spec import CameraSpec, PriorSpec, RollingShutterSpec
from aerotri.simulation.projection import TrueCamera
from aerotri.simulation.spec_table import InteriorName


def block_camera(name: str, spec: CameraSpec) -> Camera:
    """The camera as block.toml states it; what the spec does not name is held."""
    values: dict[InteriorName, float] = {
        "focal_length_mm": spec.focal_length_mm,
        "x0_mm": spec.principal_point_mm[0],
        "y0_mm": spec.principal_point_mm[1],
    }
    held = PriorSpec(fixed=True)
    return Camera(
        name=name,
        model=spec.model,
        size_px=spec.size_px,
        pixel_um=spec.pixel_um,
        interior={str(key): _prior(spec.interior.get(key, held), value) for key, value in values.items()},
        brown={str(key): _prior(prior, 0.0) for key, prior in spec.brown.items()},
        lens={str(key): _prior(prior, 0.0) for key, prior in spec.lens.items()},
        projection=spec.projection,
        flight_axis=spec.flight_axis,
        rolling_shutter=None if spec.rolling_shutter is None else _stated_shutter(spec.rolling_shutter),
    )


def _stated_shutter(spec: RollingShutterSpec) -> RollingShutter:
    readout = _prior(spec.stated, spec.readout_ms)
    return RollingShutter(readout, spec.row_direction, spec.motion, rotation=spec.rotation)


def true_camera(name: str, spec: CameraSpec) -> TrueCamera:
    """The camera as it is: the calibrated values and what the spec says is wrong with them."""
    wrong = spec.errors.interior
    lens = {str(key): value for key, value in spec.errors.lens.items()}
    return TrueCamera(
        nominal=block_camera(name, spec),
        focal_length=spec.focal_length_mm + wrong.get("focal_length_mm", 0.0),
        x0=spec.principal_point_mm[0] + wrong.get("x0_mm", 0.0),
        y0=spec.principal_point_mm[1] + wrong.get("y0_mm", 0.0),
        lens=forward_lens.vector(lens, spec.projection == "fisheye"),
        scan=_true_scan(spec),
    )


def _true_scan(spec: CameraSpec) -> np.ndarray:
    """(2,) s per mm: a ray at (x, y) is exposed scan·(x, y) after the middle of the readout."""
    if spec.rolling_shutter is None:
        return np.zeros(2)
    size_mm = np.array(spec.size_px) * spec.pixel_um * 1e-3
    return 1e-3 * spec.rolling_shutter.readout_ms * np.array(READING[spec.rolling_shutter.row_direction]) / size_mm


def _prior(spec: PriorSpec, value: float) -> Prior:
    return Prior(value if spec.value is None else spec.value, spec.sigma, spec.fixed)
