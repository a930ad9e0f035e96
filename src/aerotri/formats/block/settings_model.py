"""What block.toml may hold: every key with its type, range, unit, default and effect.

The reference of the documentation and `aerotri explain` are made from these descriptions.
"""

from __future__ import annotations

from math import radians
from typing import Annotated, Literal

from pydantic import Field, model_validator

from aerotri.conventions import LARGEST
from aerotri.formats.block.camera_model import CameraModel
from aerotri.formats.block.project_model import ProjectModel
from aerotri.formats.block.settings_types import (
    Fraction,
    NotNegative,
    OffOn,
    Positive,
    Section,
    Three,
    ThreeGroundSigmas,
    ThreePositive,
    ThreePriorsModel,
)
from aerotri.formats.text.described_key import key
from aerotri.observations import Mounting, Rig


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
    default_control_sigma_m: ThreeGroundSigmas | None = key(
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
        "EPSG:25832, with a code for the heights EPSG:25832+7837. Without a code for the heights their system is not "
        "named, and the computation takes them for ellipsoidal."
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
