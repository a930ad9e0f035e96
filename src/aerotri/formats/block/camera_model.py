"""What block.toml and camera files say of a camera: every key with its type, range, unit, default and effect."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field, model_validator

from aerotri.formats.block.settings_types import (
    Pixels,
    Positive,
    PriorModel,
    RollingShutterModel,
    Section,
    Two,
)
from aerotri.formats.text.described_key import key
from aerotri.functional_model.additional_parameters.given_values import reason_against
from aerotri.observations import Camera, Prior
from aerotri.observations.block import BROWN_NAMES, INTERIOR_ELEMENTS, LENS_NAMES


class InteriorModel(Section):
    """Interior orientation as unknowns; an element that is not named is held at the camera's own value."""

    focal_length_mm: PriorModel | None = key(None, "Principal distance (calibrated focal length) as an unknown.", "mm")
    x0_mm: PriorModel | None = key(None, "x of the principal point as an unknown, from the image centre.", "mm")
    y0_mm: PriorModel | None = key(None, "y of the principal point as an unknown, from the image centre.", "mm")


class BrownModel(Section):
    """Values and σ of Brown's lens parameters. What `additional_parameters` does not name is held at its value."""

    K1: PriorModel | None = key(None, "Brown's radial distortion, term r³.", "mm⁻²")
    K2: PriorModel | None = key(None, "Brown's radial distortion, term r⁵.", "mm⁻⁴")
    K3: PriorModel | None = key(None, "Brown's radial distortion, term r⁷.", "mm⁻⁶")
    P1: PriorModel | None = key(None, "Brown's decentring distortion along x.", "mm⁻¹")
    P2: PriorModel | None = key(None, "Brown's decentring distortion along y.", "mm⁻¹")
    b1: PriorModel | None = key(None, "Affinity: scale of x against y.")
    b2: PriorModel | None = key(None, "Affinity: shear of x.")


class LensModel(Section):
    """Values and σ of the lens model of OpenCV, COLMAP and Metashape, family lens. What `additional_parameters` does
    not name is held at its value."""

    k1: PriorModel | None = key(None, "Radial distortion as in OpenCV, term of the third power.")
    k2: PriorModel | None = key(None, "Radial distortion as in OpenCV, term of the fifth power.")
    p1: PriorModel | None = key(None, "Decentring distortion as in OpenCV, mainly along y.")
    p2: PriorModel | None = key(None, "Decentring distortion as in OpenCV, mainly along x.")
    k3: PriorModel | None = key(None, "Radial distortion as in OpenCV, term of the seventh power.")
    k4: PriorModel | None = key(None, "Radial distortion, term of the ninth power; Metashape's and a fisheye's k4.")
    q1: PriorModel | None = key(None, "Denominator of the radial distortion, second power; OpenCV's k4.")
    q2: PriorModel | None = key(None, "Denominator of the radial distortion, fourth power; OpenCV's k5.")
    q3: PriorModel | None = key(None, "Denominator of the radial distortion, sixth power; OpenCV's k6.")
    sx: PriorModel | None = key(None, "Thin prism distortion along x, term of the second power.")
    sy: PriorModel | None = key(None, "Thin prism distortion along y, term of the second power.")
    b1: PriorModel | None = key(None, "Affinity after the distortion: scale of x against y; Metashape's B1 over f.")
    b2: PriorModel | None = key(None, "Affinity after the distortion: shear of x; minus Metashape's B2 over f.")


class CameraModel(Section):
    """A camera. NAME is what images.csv has in its column camera."""

    model: Literal["frame", "ultracam_d", "dmc"] = key(
        "frame", "Kind of camera. frame: any camera with one sensor, film cameras too. ultracam_d and dmc: cameras "
        "composed of several sensors, which have parameter families of their own."
    )  # fmt: skip
    size_px: Annotated[list[Pixels], Field(min_length=2, max_length=2)] = key(
        ..., "Size of the photograph: columns, rows.", "px"
    )
    pixel_um: Positive = key(..., "Size of a pixel in the image plane.", "µm")
    focal_length_mm: Positive = key(..., "Principal distance (calibrated focal length).", "mm")
    principal_point_mm: Two = key(
        [0.0, 0.0], "Principal point x0, y0 from the image centre; x to the right, y up.", "mm"
    )
    projection: Literal["perspective", "fisheye"] = key(
        "perspective", "Kind of lens. A ray at the angle θ to the axis is recorded at c·tan θ (perspective) or c·θ "
        "(fisheye) from the principal point, before the distortion of the lens."
    )  # fmt: skip
    flight_axis: Literal["+x", "-x", "+y", "-y"] | None = key(
        None, "Image axis that points along the flight. The parameters of ultracam_d and dmc need it to place the "
        "sensors (+y where it is not given); model deformation takes the base along it (+x where it is not given)."
    )  # fmt: skip
    interior: InteriorModel = key(
        InteriorModel(), "Which elements of the interior orientation are unknowns. What is not named is held."
    )
    brown: BrownModel = key(
        BrownModel(), 'Start values and σ of Brown\'s lens parameters, for additional_parameters "brown:…".'
    )
    lens: LensModel = key(
        LensModel(), 'Start values and σ of the OpenCV lens parameters, for additional_parameters "lens:…".'
    )
    parameters: dict[str, PriorModel] = key(
        {}, 'Values and σ of parameters of the other families, by name, as in "bluh.9" = { value = 1.2e-7, '
        "fixed = true }: from a calibration or another block. What `additional_parameters` does not name is held at "
        "its value."
    )  # fmt: skip
    interior_orientation: Literal["affine", "projective", "similarity"] | None = key(
        None, "Scanned film: transformation from pixels of the scan to the calibrated fiducial marks."
    )
    fiducials: dict[str, Two] = key(
        {}, "Scanned film: calibrated position x, y of every fiducial mark, by its name in fiducials.csv.", "mm"
    )

    rolling_shutter: RollingShutterModel = key(
        RollingShutterModel(), "Rolling shutter: the rows are exposed one after the other. It acts where readout_ms is "
        "given."
    )  # fmt: skip

    @model_validator(mode="after")
    def _fisheye_of_one_sensor(self) -> CameraModel:
        if self.projection == "fisheye" and self.model != "frame":
            raise ValueError(f'projection = "fisheye" does not go with model = "{self.model}", it needs "frame"')
        return self

    @model_validator(mode="after")
    def _parameters_of_families(self) -> CameraModel:
        for name in self.parameters:
            why = reason_against(name, self.model)
            if why:
                raise ValueError(f"parameters.{name}: {why}")
        return self

    @model_validator(mode="after")
    def _focal_length_positive(self) -> CameraModel:
        given = self.interior.focal_length_mm
        if given is not None and given.value is not None and given.value <= 0:
            raise ValueError(f"interior.focal_length_mm has value = {given.value}, it should be greater than 0")
        return self

    def camera(self, name: str) -> Camera:
        """The record; interior elements that are not named are fixed at the camera's own values."""
        own = dict(zip(INTERIOR_ELEMENTS, (self.focal_length_mm, *self.principal_point_mm), strict=True))
        interior = {}
        for element, value in own.items():
            given: PriorModel | None = getattr(self.interior, element)
            interior[element] = Prior(float(value), fixed=True) if given is None else given.prior(float(value))
        return Camera(
            name=name,
            model=self.model,
            size_px=(self.size_px[0], self.size_px[1]),
            pixel_um=float(self.pixel_um),
            interior=interior,
            brown=_priors(self.brown, BROWN_NAMES),
            lens=_priors(self.lens, LENS_NAMES),
            parameters={name: model.prior() for name, model in self.parameters.items()},
            projection=self.projection,
            flight_axis=self.flight_axis,
            fiducials={name: (float(x), float(y)) for name, (x, y) in self.fiducials.items()},
            interior_orientation=self.interior_orientation,
            rolling_shutter=self.rolling_shutter.rolling_shutter(),
        )


def _priors(section: BaseModel, names: tuple[str, ...]) -> dict[str, Prior]:
    given = {name: getattr(section, name) for name in names}
    return {name: model.prior() for name, model in given.items() if model is not None}
