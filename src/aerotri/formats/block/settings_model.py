"""What block.toml may hold: every key with its type, range, unit, default and effect.

The reference of the documentation and `aerotri explain` are made from these descriptions.
"""

from __future__ import annotations

from math import radians
from typing import Annotated, Literal

from pydantic import BaseModel, Field, model_validator

from aerotri.conventions import LARGEST
from aerotri.formats.block.project_model import ProjectModel
from aerotri.formats.block.settings_types import (
    Fraction,
    NotNegative,
    OffOn,
    Pixels,
    Positive,
    PriorModel,
    RollingShutterModel,
    Section,
    Three,
    ThreeNotNegative,
    ThreePositive,
    ThreePriorsModel,
    Two,
)
from aerotri.formats.text.described_key import key
from aerotri.functional_model.additional_parameters.given_values import reason_against
from aerotri.observations import Camera, Mounting, Prior, Rig
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


class StochasticModel(Section):
    """Standard deviations where the tables give none."""

    image_sigma_um: Positive | None = key(
        None, "Standard deviation of an image coordinate where image_points.csv gives none. Needed where the table has "
        "no sx and sy.", "µm"
    )  # fmt: skip
    correlated: OffOn = key(
        "off", "on: besides their noise, the image points of a photograph have a smooth error in common, another one "
        "in every photograph: of matching, film, or a lens that moves. For blocks of up to 222 photographs."
    )  # fmt: skip
    correlated_sigma_um: Positive | None = key(
        None, "Standard deviation of this error; estimated from the block where it is not given.", "µm"
    )
    correlation_length_mm: Positive | None = key(
        None, "Distance in the photograph after which the correlation of this error has fallen to 37 %; estimated from "
        "the block where it is not given.", "mm"
    )  # fmt: skip
    default_control_sigma_m: ThreeNotNegative | None = key(
        None, "Standard deviation of X, Y, Z of control and check points where control.csv gives none; 0 holds the "
        "coordinate without error.", "m"
    )  # fmt: skip


class AdjustmentModel(Section):
    """How the block is adjusted."""

    additional_parameters: list[str] = key(
        ["auto"], "Parameters of systematic image errors (self-calibration): FAMILY:ITEMS, items joined by + and "
        "ranges by -, such as \"bluh:1-8+12\" or \"brown:K1+K2+P1+P2\"; \"auto\" takes the set that predicts parts of "
        "the block best that it was not fitted to. `aerotri parameters` lists them. Empty: none."
    )  # fmt: skip
    parameter_groups: str = key(
        "camera", "Photographs that share one set of additional parameters: camera, block, strip, or the name of a "
        "column of images.csv, such as day."
    )  # fmt: skip
    parameter_position: Literal["adjusted", "measured"] = key(
        "adjusted", "Position in the photograph at which additional parameters are evaluated. adjusted: that of the "
        "adjusted image point. measured: that of the measured one, as other programs do; the noise of the image points "
        "then bends blocks that little else holds."
    )  # fmt: skip
    parameter_selection: OffOn = key(
        "off", "on: additional parameters that are not significant or too highly correlated are removed, one after "
        "another, each with a new adjustment."
    )  # fmt: skip
    t_limit: Annotated[float, Field(ge=0, le=LARGEST)] = key(
        1.0, "Selection: a parameter is removed when its value divided by its σ is below this."
    )
    correlation_limit: Annotated[float, Field(gt=0, le=1)] = key(
        0.85, "Selection: of two parameters with a higher correlation one is removed; so is a parameter whose total "
        "correlation with all others is higher."
    )  # fmt: skip
    robust: Literal["off", "huber", "danish", "cauchy", "adaptive", "data-snooping"] = key(
        "off", "Robust estimation. huber, danish, cauchy, adaptive: image points with large residuals get less weight. "
        "data-snooping: they are tested and removed one after another."
    )  # fmt: skip
    datum: Literal["control", "minimal", "inner", "fixed"] = key(
        "control", "What fixes position, rotation and scale. control: control points and GNSS. minimal: as few "
        "coordinates as are needed. inner: free network, the mean shift of the datum points is zero. fixed: the "
        "elements of datum_fixed. With minimal and inner, control is compared only."
    )  # fmt: skip
    datum_points: list[str] = key([], 'datum = "inner": names of the points that carry the datum; empty: all points.')
    datum_fixed: list[str] = key(
        [], "datum = \"fixed\": orientation elements that are held, as PHOTOGRAPH:ELEMENT, such as \"1_001:X0\". "
        "Elements are X0 Y0 Z0 omega phi kappa."
    )  # fmt: skip
    variance_components: OffOn = key(
        "off", "on: the σ of image points, control, GNSS and INS are estimated from the residuals, group by group."
    )
    model_part: OffOn = key(
        "on", "on: strips, days and other groups of photographs are tested for errors that they share; where they do, "
        "σ gets a model part (mX, mY, mZ) beside that of the noise. off: σ of the noise alone."
    )  # fmt: skip
    start: Literal["auto", "strips", "points"] = key(
        "auto", "Where start values of photographs without orientation come from. strips: control points and strips "
        "along the track, quick. points: the tie points alone, brought onto GNSS and control, for every geometry; "
        "orientations that are given are not used. auto: strips, and points where these do not hold."
    )  # fmt: skip
    alpha: Fraction = key(
        0.001, "Significance level of the tests of residuals: 0.001 means one false alarm in a thousand tests."
    )
    power: Fraction = key(
        0.80, "Probability with which an error of the size of the marginally detectable error is found."
    )
    max_iterations: Annotated[int, Field(ge=1, le=100_000)] = key(30, "Iterations at most.")


class CorrectionsModel(Section):
    """Corrections of image coordinates before the adjustment."""

    refraction: Literal["off", "standard"] = key(
        "off", "standard: refraction by the standard atmosphere is taken off; heights count from sea level."
    )
    earth_curvature: OffOn = key(
        "off", "on: earth curvature is taken off; for crs = \"local\" only. A block with an EPSG code is adjusted on "
        "the curved earth anyway."
    )  # fmt: skip


class GnssModel(Section):
    """Positions of gnss_ins.csv."""

    shift: Literal["off", "block", "strip"] = key(
        "off", "Constant shift X, Y, Z of the GNSS positions as an unknown: one for the block, or one a strip. A shift "
        "in height can hide a wrong principal distance, so it is off unless asked for."
    )  # fmt: skip
    drift: Literal["off", "block", "strip"] = key(
        "off", "Linear drift of the GNSS positions with time as an unknown: one for the block, or one a strip. Needs "
        "the column time."
    )  # fmt: skip
    lever_arm_m: Three = key(
        [0.0, 0.0, 0.0], "From the projection centre to the antenna, in the camera frame: x right, y up, z backwards "
        "(away from the ground).", "m"
    )  # fmt: skip
    lever_arm_sigma_m: ThreePositive | None = key(
        None, "Standard deviation of the lever arm, which becomes an unknown. Without it the lever arm is held.", "m"
    )
    time_offset: Literal["off", "block", "strip"] = key(
        "off", "Difference between the clocks of GNSS and camera as an unknown: one for the block, or one a strip. "
        "Needs the column time."
    )  # fmt: skip
    correlated: OffOn = key(
        "off", "on: besides their noise, positions have errors that stay for seconds to minutes, alike for photographs "
        "taken one after the other. Without it the errors of all positions are independent."
    )  # fmt: skip
    correlation_time_s: Positive | None = key(
        None, "Time after which such an error has fallen to 37 %; estimated from the block where it is not given. "
        "Where photographs have no times it is counted in exposures along the strip.", "s"
    )  # fmt: skip
    correlated_sigma_m: Annotated[list[NotNegative], Field(min_length=2, max_length=3)] | None = key(
        None, "Standard deviation of such errors: in plan and height, or in X, Y and Z; estimated from the block where "
        "it is not given.", "m"
    )  # fmt: skip
    noise_factor: Literal["estimated"] | Annotated[list[Positive], Field(min_length=2, max_length=2)] = key(
        [1.0, 1.0], "Factor of the standard deviations in gnss_ins.csv, in plan and height. estimated: found together "
        "with the errors that stay, where correlated = \"on\"."
    )  # fmt: skip


class InsModel(Section):
    """Angles of gnss_ins.csv."""

    boresight: Literal["off", "camera"] = key(
        "camera", "Boresight misalignment between INS and camera as three unknowns for every camera; off: none."
    )
    drift: Literal["off", "strip"] = key(
        "off", "Linear drift of the angles with time as an unknown in every strip. Needs the column time."
    )


class CollocationModel(Section):
    """The distortion model without assumptions about the camera, additional_parameters "collocation"."""

    sigma_um: Positive | None = key(
        None, "Standard deviation of the image error; estimated from the block where it is not given.", "µm"
    )
    length_mm: Positive | None = key(
        None, "Distance in the image over which the error stays alike (correlation length); estimated from the block "
        "where it is not given.", "mm"
    )  # fmt: skip


class DeviationsModel(Section):
    """How additional parameters differ between the groups of `adjustment.parameter_groups`. Family interior of
    `additional_parameters` stands for the interior orientation."""

    kind: Literal["free", "independent", "walk"] = key(
        "free", "free: the groups have nothing to do with one another. independent: the values of the groups scatter "
        "about a mean that all photographs share. walk: they drift, from each group to the next in the order of flight."
    )  # fmt: skip
    sigma_um: dict[str, Positive] = key(
        {}, "Standard deviation by parameter, as in \"brown.K1\" = 0.3: of the values about their mean, or of the step "
        "from group to group; as image error, root mean square over the format. Empty: estimated from the block.",
        "µm"
    )  # fmt: skip


class MountingModel(Section):
    """A camera of a rig in the frame of the reference camera: X_reference = position + R·X_camera. NAME is the
    camera's."""

    position_m: ThreePriorsModel = key(
        ThreePriorsModel(), "Projection centre x, y, z in the frame of the reference camera: value, sigma (without it "
        "free), or fixed = true.", "m"
    )  # fmt: skip
    rotation_deg: ThreePriorsModel = key(
        ThreePriorsModel(), "Angles omega, phi, kappa of R, in the order that `rotation` says: value, sigma (without "
        "it free), or fixed = true. Values within 10 degrees are good enough. Without values they are computed from "
        "the orientations of the photographs.", "deg"
    )  # fmt: skip

    movement_m: NotNegative | Literal["estimated"] = key(
        0.0, "Standard deviation of the movements of the projection centre between exposures, an axis, where "
        'constraint = "weighted". "estimated": from the block.', "m"
    )  # fmt: skip
    movement_deg: NotNegative | Literal["estimated"] = key(
        "estimated", "Standard deviation of the rotations of the camera between exposures, an axis, where "
        'constraint = "weighted". "estimated": from the block.', "deg"
    )  # fmt: skip

    @model_validator(mode="after")
    def _held_at_something(self) -> MountingModel:
        if self.rotation_deg.value is None and self.rotation_deg.fixed is not False:
            raise ValueError("rotation_deg is fixed without a value")
        return self

    def mounting(self) -> Mounting:
        """The record."""
        rotation = self.rotation_deg
        return Mounting(
            self.position_m.priors(), rotation.priors(radians(1.0)), rotation.value is not None,
            None if isinstance(self.movement_m, str) else self.movement_m,
            None if isinstance(self.movement_deg, str) else radians(self.movement_deg),
        )  # fmt: skip


class RigModel(Section):
    """Cameras on one frame that are triggered together. The column station of images.csv says which photographs belong
    to one exposure."""

    reference: str = key(..., "Name of the camera whose position and rotation are those of the rig.")
    constraint: Literal["rigid", "weighted", "off"] = key(
        "rigid", "rigid: position and rotation of the cameras on the rig are the same at all exposures. weighted: they "
        "may move a little from exposure to exposure. off: the cameras are independent."
    )  # fmt: skip
    camera: dict[str, MountingModel] = key({}, "The other cameras of the rig, one table [rig.NAME.camera.NAME] each.")

    def rig(self, name: str) -> Rig:
        """The record."""
        return Rig(
            name,
            self.reference,
            {camera: mounting.mounting() for camera, mounting in self.camera.items()},
            self.constraint,
        )


class BlockModel(Section):
    """block.toml."""

    name: str | None = key(None, "Name of the block; that of its folder where it is not given.")
    crs: Annotated[str, Field(pattern=r"^(local|EPSG:[0-9]+(\+[0-9]+)?)$")] = key(
        "local", "Coordinate system of all coordinates: local (right-handed, metres), or an EPSG code such as "
        "EPSG:25832, with a code for the heights EPSG:25832+7837. Without a code for the heights they are ellipsoidal."
    )  # fmt: skip
    angle_unit: Literal["deg", "gon", "rad"] = key("deg", "Unit of all angles in the tables.")
    rotation: Literal["omega-phi-kappa", "phi-omega-kappa"] = key(
        "omega-phi-kappa", "Order of the angles: R = Rx(ω)·Ry(φ)·Rz(κ), or R = Ry(φ)·Rx(ω)·Rz(κ)."
    )
    image_unit: Literal["mm", "um", "px"] = key(
        "mm", "Unit of image_points.csv. mm and um: from the image centre, x right, y up. px: column and row, (0, 0) "
        "is the corner of the upper left pixel."
    )  # fmt: skip
    camera: Annotated[dict[str, CameraModel], Field(min_length=1)] = key(
        ..., "The cameras, one table [camera.NAME] each; at least one."
    )
    stochastic: StochasticModel = key(StochasticModel(), "Standard deviations where the tables give none.")
    adjustment: AdjustmentModel = key(AdjustmentModel(), "How the block is adjusted.")
    corrections: CorrectionsModel = key(CorrectionsModel(), "Corrections of image coordinates before the adjustment.")
    gnss: GnssModel = key(GnssModel(), "How the positions of gnss_ins.csv are used.")
    ins: InsModel = key(InsModel(), "How the angles of gnss_ins.csv are used.")
    collocation: CollocationModel = key(
        CollocationModel(), "The distortion model without assumptions about the camera (additional_parameters "
        "\"collocation\")."
    )  # fmt: skip
    deviations: DeviationsModel = key(
        DeviationsModel(), "How additional parameters differ between groups of photographs."
    )
    rig: dict[str, RigModel] = key({}, "Rigs: cameras on one frame, one table [rig.NAME] each.")
    project: ProjectModel = key(ProjectModel(), "Title, client and the like: they stand at the head of the report.")


class CamerasModel(Section):
    """The cameras of block.toml in a file of their own."""

    camera: Annotated[dict[str, CameraModel], Field(min_length=1)] = key(
        ..., "The cameras, one table [camera.NAME] each."
    )
