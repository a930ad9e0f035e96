"""The image error of every camera (and day), the sum of what a spec asks for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import Parameter, brown, is_item, parameter_set
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES, ParameterSet
from aerotri.functional_model.additional_parameters.ultracam_d import native_from_image
from aerotri.functional_model.orientation_patterns import orientation_patterns
from aerotri.observations import Camera
from aerotri.observations.block import BROWN_NAMES
from aerotri.simulation.camera_errors import dmc, frame, ultracam_d
from aerotri.simulation.camera_errors.lens import format_grid
from aerotri.simulation.camera_spec import ErrorSpec, PhysicalErrorSpec
from aerotri.simulation.projection import Field, TrueCamera
from aerotri.simulation.random_streams import stream

MACHINES: Mapping[str, tuple[Callable[[Camera, dict[str, float], np.random.Generator], Field], Mapping[str, float]]] = {
    "ultracam_d": (ultracam_d.ultracam_d_error, ultracam_d.WEIGHTS),
    "dmc": (dmc.dmc_error, dmc.WEIGHTS),
    "frame": (frame.frame_error, frame.WEIGHTS),
}
GRID = (115, 75)
"""Columns and rows of positions that an RMS is taken over: every 100 pixels of an UltraCamD, whose tiles then have 37 ×
24 of them."""
CHUNK = 20_000
"""Positions evaluated at a time; chosen [C]: some 44 patterns of them in both coordinates are 14 MB."""


@dataclass(frozen=True, eq=False)
class ParametricPart:
    """Σ value·basis of a parameter set."""

    parameters: ParameterSet
    values: np.ndarray

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.parameters.basis(x, y) @ self.values


@dataclass(frozen=True, eq=False)
class BrownPart:
    """Brown's lens error about the true principal point."""

    x0: float
    y0: float
    values: np.ndarray

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return brown.image_error(x - self.x0, y - self.y0, self.values)


@dataclass(frozen=True, eq=False)
class PhysicalPart:
    """The error of a machine less what the orientation takes, scaled.

    Parameters
    ----------
    machine : error in native axes.
    native : (2, 2) image axes → native axes.
    focal_length : mm; orientation : (6,) coefficients of `orientation_patterns`.
    factor : scale to the RMS asked for.
    """

    machine: Field
    native: np.ndarray
    focal_length: float
    orientation: np.ndarray
    factor: float

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        position = np.stack([x, y], axis=1) @ self.native.T
        return self.factor * self.in_native(position[:, 0], position[:, 1]) @ self.native

    def in_native(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2) mm unscaled, in native axes."""
        return self.machine(x, y) - orientation_patterns(x, y, self.focal_length) @ self.orientation


@dataclass(frozen=True, eq=False)
class ImageError:
    """d(x, y) of one camera: measured = ideal + d, d at the measured position; the sum of its parts.

    Parameters
    ----------
    parts : fields (n,) x, (n,) y → (n, 2), mm.
    """

    parts: tuple[Field, ...]

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2) mm at image positions (n,) mm; evaluated in pieces that stay in the cache."""
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        error = np.zeros((len(x), 2))
        for start in range(0, len(x) if self.parts else 0, CHUNK):
            piece = slice(start, start + CHUNK)
            for part in self.parts:
                error[piece] += part(x[piece], y[piece])
        return error


def rms_mm(field: Field, camera: Camera) -> float:
    """RMS of a coordinate of an image error over the format, √(mean(dx² + dy²)/2), mm."""
    x, y = format_grid(camera.half_format_mm, *GRID)
    return float(np.sqrt(np.mean(field(x, y) ** 2)))


def physical_part(camera: Camera, spec: PhysicalErrorSpec, rms: float, rng: np.random.Generator) -> PhysicalPart:
    """A physical error drawn at random, scaled to an RMS.

    The six orientation patterns are taken out first: they are no error of the camera, a block never sees them, and the
    RMS would mostly be theirs.

    Parameters
    ----------
    rms : mm of a coordinate over the format.
    """
    make, defaults = MACHINES[camera.model]
    unknown = set(spec.weights) - set(defaults)
    if unknown:
        raise InputError(
            f"'camera.{camera.name}.errors.physical.weights' has the unknown key '{min(unknown)}'",
            f"a {camera.model} camera has {', '.join(defaults)}",
        )
    machine = make(camera, {**defaults, **spec.weights}, rng)
    native = native_from_image(camera) if camera.model != "frame" else np.eye(2)
    f = camera.focal_length_mm
    half = np.abs(native) @ np.array(camera.half_format_mm)
    x, y = format_grid((half[0], half[1]), *GRID)
    design = orientation_patterns(x, y, f).reshape(-1, 6)
    orientation = np.linalg.lstsq(design, machine(x, y).ravel(), rcond=None)[0]
    size = float(np.sqrt(np.mean(PhysicalPart(machine, native, f, orientation, 1.0).in_native(x, y) ** 2)))
    if size <= 1e-9 * sum({**defaults, **spec.weights}.values()):
        raise InputError(
            f"'camera.{camera.name}.errors.physical.weights' leave no error after stitching and orientation",
            "give another cause weight",
        )
    return PhysicalPart(machine, native, f, orientation, rms / size)


def _parametric_parts(camera: Camera, errors: ErrorSpec) -> list[Field]:
    key = f"camera.{camera.name}.errors.parameters"
    families: dict[str, dict[str, float]] = {}
    for name, value in errors.parameters.items():
        parameter = Parameter.of(name)
        family, item = parameter.family, parameter.item
        if family not in LINEAR_FAMILIES:
            raise InputError(f"'{key}' has the unknown key '{name}'", f"families are {', '.join(LINEAR_FAMILIES)}")
        if not is_item(family, item):
            items = LINEAR_FAMILIES[family].items
            raise InputError(f"'{key}' has the unknown key '{name}'", f"'{family}' has {items[0]} to {items[-1]}")
        if item in LINEAR_FAMILIES[family].needs_height:
            raise InputError(f"'{key}.{name}' depends on the heights of the points", "leave it out")
        families.setdefault(family, {})[item] = value
    parts: list[Field] = []
    for family, values in families.items():
        chosen = parameter_set(family, values, camera)
        parts.append(ParametricPart(chosen, np.array([values[item] for item in chosen.items])))
    return parts


def image_error_fields(
    cameras: Sequence[TrueCamera], errors: Mapping[str, ErrorSpec], days: Sequence[str], seed: int
) -> dict[tuple[str, str], ImageError]:
    """The image error of every camera on every day.

    Parameters
    ----------
    errors : by camera name.
    days : ('',) when the flight knows no days.

    Returns
    -------
    By (camera name, day); the same object on all days where nothing changes.
    """
    fields = {}
    for camera in cameras:
        nominal, spec = camera.nominal, errors[camera.nominal.name]
        parts = _parametric_parts(nominal, spec)
        if spec.brown:
            values = np.array([spec.brown.get(name, 0.0) for name in BROWN_NAMES])
            parts.append(BrownPart(camera.x0, camera.y0, values))
        parts += _physical_parts(nominal, spec.physical, seed, "")
        constant = ImageError(tuple(parts))
        for day in days:
            change = _physical_parts(nominal, spec.physical, seed, day) if day else []
            fields[nominal.name, day] = ImageError((*parts, *change)) if change else constant
    return fields


def _physical_parts(camera: Camera, spec: PhysicalErrorSpec | None, seed: int, day: str) -> list[Field]:
    """The machine's error as far as it stays (day ''), or what a day adds."""
    size_um = 0.0 if spec is None else spec.day_change_um if day else spec.rms_um
    if spec is None or size_um == 0.0:
        return []
    rng = stream(seed if spec.seed is None else spec.seed, "camera", camera.name, day)
    return [physical_part(camera, spec, size_um * 1e-3, rng)]
