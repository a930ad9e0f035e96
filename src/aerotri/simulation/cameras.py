"""Cameras of a spec: as the block states them, and as they are."""

from __future__ import annotations

import numpy as np

from aerotri.observations import Camera, Prior
from aerotri.observations.block import LENS_NAMES
from aerotri.simulation.projection import TrueCamera
from aerotri.simulation.spec import CameraSpec, InteriorName, PriorSpec


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
        flight_axis=spec.flight_axis,
    )


def true_camera(name: str, spec: CameraSpec) -> TrueCamera:
    """The camera as it is: the calibrated values and what the spec says is wrong with them."""
    wrong = spec.errors.interior
    lens = {str(key): value for key, value in spec.errors.lens.items()}
    return TrueCamera(
        nominal=block_camera(name, spec),
        focal_length=spec.focal_length_mm + wrong.get("focal_length_mm", 0.0),
        x0=spec.principal_point_mm[0] + wrong.get("x0_mm", 0.0),
        y0=spec.principal_point_mm[1] + wrong.get("y0_mm", 0.0),
        lens=np.array([lens.get(key, 0.0) for key in LENS_NAMES]),
    )


def _prior(spec: PriorSpec, value: float) -> Prior:
    return Prior(value if spec.value is None else spec.value, spec.sigma, spec.fixed)
