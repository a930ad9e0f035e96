"""The spec of a simulation: what `simulation.toml` may say, checked key by key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from aerotri.formats.text.described_key import key
from aerotri.simulation.camera_spec import CameraSpec
from aerotri.simulation.rig_presets import with_rig_presets
from aerotri.simulation.spec_table import (
    Count,
    Lap,
    Name,
    NotNegative,
    Number,
    Number0,
    Positive,
    Probability,
    Share,
    Table,
    Triple,
    Vector,
)


class CrossStripSpec(Table):
    """A strip across the others; `position` 0–1 along them. Without `images` it spans the outer strip axes."""

    position: Share = key(0.5, "Where it crosses the other strips: 0 at their beginning, 1 at their end.")
    images: Count | None = key(None, "Photographs; as many as span the strips where it is not given.")
    end_lap: Lap | None = key(None, "End lap, 0 to 0.95; that of the flight where it is not given.")
    camera: str | None = key(None, "Its camera; the first where it is not given.")
    day: Count | None = key(None, "Day on which it is flown, from 1.")


class FlightSpec(Table):
    """The flight plan: parallel strips at a constant height above the mean ground, and cross strips.

    `heading_deg` clockwise from grid north; `area_m` (along, across) is covered by models throughout. Several
    `cameras` or `days` share the strips in runs of equal number.
    """

    gsd_m: Positive | None = key(None, "Size of a pixel on the ground; give this or height_m.", "m")
    height_m: Positive | None = key(None, "Flying height over the mean ground; give this or gsd_m.", "m")
    area_m: tuple[Positive, Positive] | None = key(
        None, "Area covered by stereo models, along and across the strips; or give strips and images_per_strip.", "m"
    )
    strips: Count | None = key(None, "Number of parallel strips.")
    images_per_strip: Count | None = key(None, "Photographs in a strip.")
    end_lap: Lap = key(0.6, "Overlap of photographs in a strip, 0 to 0.95.")
    side_lap: Lap = key(0.3, "Overlap of neighbouring strips, 0 to 0.95.")
    heading_deg: Number = key(90.0, "Direction of flight, clockwise from grid north.", "deg")
    centre_m: tuple[Number, Number] = key((0.0, 0.0), "X and Y of the middle of the block.", "m")
    alternating: bool = key(True, "true: every second strip is flown backwards.")
    cross_strips: tuple[CrossStripSpec, ...] = key(
        (), "Strips across the others, a table [[flight.cross_strips]] each."
    )
    attitude_sigma_deg: Triple = key(
        (0.0, 0.0, 0.0), "Standard deviation of the true omega, phi, kappa around the plan.", "deg"
    )
    position_sigma_m: Triple = key((0.0, 0.0, 0.0), "Standard deviation of the true X, Y, Z around the plan.", "m")
    cameras: tuple[str, ...] = key(
        (), "Cameras that share the strips in runs of equal number; empty: the first camera."
    )
    days: Count | None = key(None, "Days that share the strips; images.csv gets a column day.")
    speed_m_s: Positive = key(70.0, "Speed, for the times of the exposures.", "m/s")
    turn_s: NotNegative = key(240.0, "Time from the end of a strip to the next.", "s")

    @model_validator(mode="after")
    def _either_or(self) -> FlightSpec:
        if (self.gsd_m is None) == (self.height_m is None):
            raise ValueError("give either gsd_m or height_m")
        numbers = (self.strips is not None, self.images_per_strip is not None)
        if numbers not in ((True, True), (False, False)) or (self.area_m is None) != all(numbers):
            raise ValueError("give either area_m or both strips and images_per_strip")
        for cross in self.cross_strips:
            if cross.day is not None and cross.day > (self.days or 0):
                raise ValueError(f"a cross strip is flown on day {cross.day} of {self.days or 0} days")
        return self


class TerrainSpec(Table):
    """The ground; `height_m` is its mean level. A hill may stand on undulating ground too.

    `hills` are more of them, on any ground: X and Y from the middle of the block, height (negative: a pit), radius, m.
    `houses` have flat roofs: middle X and Y from the middle of the block, size along X and along Y, height, m.
    """

    kind: Literal["flat", "undulating", "hill"] = key("flat", "Shape of the ground.")
    height_m: Number = key(0.0, "Mean height.", "m")
    relief_rms_m: NotNegative = key(0.0, "RMS of the relief of undulating ground.", "m")
    wavelength_m: Positive = key(1000.0, "Wavelength of undulating ground.", "m")
    hill_height_m: Number = key(0.0, "Height of a hill; it may stand on any ground.", "m")
    hill_radius_m: Positive = key(100.0, "Radius of the hill.", "m")
    hill_centre_m: tuple[Number, Number] = key((0.0, 0.0), "X and Y of the hill.", "m")
    hills: tuple[tuple[Number, Number, Number, Positive], ...] = key(
        (), "More hills: X, Y from the middle of the block, height (negative: a pit), radius.", "m"
    )
    houses: tuple[tuple[Number, Number, Positive, Positive, Positive], ...] = key(
        (), "Houses: X, Y from the middle of the block, size along X and Y, height.", "m"
    )


class TiePointSpec(Table):
    """Tie points. `rays_per_point` sets the probability of a point being measured in an image that sees it.

    'clusters': around the nodes of a `pattern` (along, across) in every image, `cluster_sigma` in units of the format;
    'nodes': the same, with a point at every node of every image before any node has its second;
    'uniform': evenly over the ground.
    """

    per_image: Positive = key(..., "Tie points in a photograph.")
    rays_per_point: Annotated[float, Field(strict=True, ge=2.0)] | None = key(
        None, "Mean number of photographs of a point; give this or probability."
    )
    probability: Probability | None = key(None, "Probability that a photograph that sees a point measures it.")
    min_rays: Annotated[int, Field(strict=True, ge=1)] = key(2, "Photographs of a point at least.")
    max_rays: Annotated[int, Field(strict=True, ge=2)] | None = key(None, "Photographs of a point at most.")
    distribution: Literal["uniform", "clusters", "nodes"] = key(
        "uniform",
        "uniform over the ground, or clusters around places in the photograph, or nodes: one at every place first.",
    )
    pattern: tuple[Count, Count] = key((3, 3), "Places along and across of clusters and nodes.")
    cluster_sigma: Positive = key(0.04, "Size of a cluster, in units of the format.")
    sigma_um: NotNegative = key(..., "Standard deviation of the measurements.", "µm")
    stated_sigma_um: Positive | None = key(
        None, "Standard deviation that the block states; the true one where it is not given.", "µm"
    )
    margin_px: NotNegative = key(20.0, "Margin of the photograph without points.", "px")

    @model_validator(mode="after")
    def _consistent(self) -> TiePointSpec:
        if self.rays_per_point is not None and self.probability is not None:
            raise ValueError("give either rays_per_point or probability")
        if self.sigma_um == 0.0 and self.stated_sigma_um is None:
            raise ValueError("sigma_um = 0 needs stated_sigma_um, the σ that the block states")
        if self.max_rays is not None and self.max_rays < self.min_rays:
            raise ValueError("max_rays is less than min_rays")
        return self


class ControlBlunderSpec(Table):
    """A control point given wrongly by `error_m`."""

    point: Name = key(..., "Name of the control point.")
    error_m: Vector = key(..., "Error of its given X, Y, Z.", "m")


class ControlSpec(Table):
    """Signalised points. The control is a grid, its mesh `distance_bases` base lengths of `base_end_lap`, or lies at
    `positions` (along, across; 0–1 of the block); check points are scattered between. σ = 0 means free of error: the
    block then states `stated_sigma_m`.
    """

    distance_bases: Positive | None = key(
        None, "Control on a grid with this mesh, in base lengths; give this or positions."
    )
    base_end_lap: Lap = key(0.6, "End lap of the base length that is meant.")
    interior: bool = key(True, "false: control at the border only.")
    positions: tuple[tuple[Number, Number], ...] = key((), "Places of the control, along and across the block, 0 to 1.")
    sigma_m: Triple = key((0.03, 0.03, 0.03), "Standard deviation of the given X, Y, Z of control.", "m")
    stated_sigma_m: tuple[Positive, Positive, Positive] | None = key(
        None, "Standard deviation that the block states; the true one where it is not given.", "m"
    )
    image_sigma_um: NotNegative | None = key(
        None, "Standard deviation of its image points; that of tie points where it is not given.", "µm"
    )
    check_points: Number0 = key(0, "Number of check points.")
    check_sigma_m: Triple | None = key(
        None, "Standard deviation of the given X, Y, Z of check points; that of control where it is not given.", "m"
    )
    blunders: tuple[ControlBlunderSpec, ...] = key(
        (), "Control points given wrongly, a table [[control.blunders]] each."
    )

    @model_validator(mode="after")
    def _stated(self) -> ControlSpec:
        if self.stated_sigma_m is None and 0.0 in (*self.sigma_m, *(self.check_sigma_m or ())):
            raise ValueError("a σ of 0 needs stated_sigma_m, the σ that the block states")
        if self.distance_bases is not None and self.positions:
            raise ValueError("give either distance_bases or positions")
        return self


class TowerSpec(Table):
    """Towers, `per_image` in the inner part of every photograph: the foot on the ground, the top `height_m` over it.

    Both are measured in every photograph that sees them. The top leaves the plumb line through the foot by `sigma_m` in
    X and in Y; the block has a condition of that σ for every tower.
    """

    height_m: Positive = key(..., "Height of the towers.", "m")
    per_image: Count = key(1, "Towers in a photograph.")
    sigma_m: Positive = key(0.01, "How far the top is off the plumb line, in X and in Y.", "m")


class GnssSpec(Table):
    """Antenna positions; shift and drift of every strip are drawn with their σ."""

    sigma_m: tuple[Positive, Positive, Positive] = key(..., "Standard deviation of observed X, Y, Z.", "m")
    shift_sigma_m: Triple = key((0.0, 0.0, 0.0), "Standard deviation of the shift of a strip.", "m")
    drift_sigma_m_s: Triple = key((0.0, 0.0, 0.0), "Standard deviation of the drift of a strip.", "m/s")
    lever_arm_m: Vector = key((0.0, 0.0, 0.0), "From the projection centre to the antenna, in the camera frame.", "m")
    correlated_sigma_m: Triple = key(
        (0.0, 0.0, 0.0), "Standard deviation of errors of X, Y, Z that stay for a while, beside sigma_m.", "m"
    )
    correlation_time_s: Positive | None = key(
        None, "Time after which such an error has fallen to 37 %; needed where they are there.", "s"
    )

    @model_validator(mode="after")
    def _with_time(self) -> GnssSpec:
        if any(self.correlated_sigma_m) and self.correlation_time_s is None:
            raise ValueError("correlated_sigma_m needs correlation_time_s, in seconds")
        return self


class InsSpec(Table):
    """Attitudes (ω, φ, κ); `boresight_deg` turns the INS into the camera."""

    sigma_deg: tuple[Positive, Positive, Positive] = key(
        ..., "Standard deviation of observed omega, phi, kappa.", "deg"
    )
    boresight_deg: Vector = key((0.0, 0.0, 0.0), "Boresight misalignment between INS and camera.", "deg")


class GrossErrorSpec(Table):
    """Gross errors of tie points: a share of the rays, uniform in size, in a random direction."""

    fraction: Annotated[float, Field(strict=True, ge=0.0, lt=1.0)] = key(
        ..., "Share of the image points of tie points that are wrong, 0 to 1."
    )
    range_sigma: tuple[NotNegative, Positive] = key(
        (10.0, 100.0), "Smallest and largest error, in standard deviations."
    )

    @model_validator(mode="after")
    def _ordered(self) -> GrossErrorSpec:
        if self.range_sigma[0] > self.range_sigma[1]:
            raise ValueError("range_sigma must rise")
        return self


class StartValueSpec(Table):
    """Start values of the orientation: none, or the truth with errors of these σ."""

    kind: Literal["none", "perturbed"] = key(
        "none", "none: the block has no start values; perturbed: the truth with errors."
    )
    position_sigma_m: NotNegative = key(1.0, "Standard deviation of the errors of positions.", "m")
    angle_sigma_deg: NotNegative = key(0.1, "Standard deviation of the errors of angles.", "deg")


class GeoreferenceSpec(Table):
    """Where on Earth the flight takes place: coordinates of the block in the CRS, `origin` there of its (0, 0, 0).

    Heights count from the ellipsoid where the CRS has no vertical part.
    """

    crs: str = key(..., "Coordinate system that the block is delivered in.")
    origin: Vector = key(..., "Its coordinates of (0, 0, 0) of the plan.", "units of crs")


class PhotographSpec(Table):
    """Photographs that are rendered: TIFF of 16 bits, or JPEG of 8 bits with EXIF as a drone writes it.

    `targets` draws bright discs at control and check points.
    """

    format: Literal["tiff", "jpeg"] = key("tiff", "tiff: 16 bit; jpeg: 8 bit with EXIF as a drone writes it.")
    targets: bool = key(False, "true: bright discs at control and check points.")


class AdjustmentSpec(Table):
    """What block.toml shall say under `[adjustment]`."""

    additional_parameters: tuple[str, ...] = key((), "As in block.toml.")
    parameter_groups: str = key("camera", "As in block.toml.")


class MountingSpec(Table):
    """A camera of a rig in the frame of the reference camera: X_reference = position + R·X_camera."""

    position_m: Vector = key((0.0, 0.0, 0.0), "True projection centre in the frame of the reference camera.", "m")
    rotation_deg: Vector = key(..., "True angles omega, phi, kappa of R.", "deg")
    stated_position_m: Vector | None = key(
        None, "Position that the block states; the true one where it is not given.", "m"
    )
    stated_rotation_deg: Vector | None = key(
        None, "Angles that the block states; the true ones where they are not given.", "deg"
    )
    position_sigma_m: tuple[Positive, Positive, Positive] | None = key(
        None, "Standard deviation of the stated position, which errs by it; without it the position is free.", "m"
    )
    rotation_sigma_deg: tuple[Positive, Positive, Positive] | None = key(
        None, "Standard deviation of the stated angles, which err by it; without it they are free.", "deg"
    )
    position_fixed: bool = key(False, "true: the block holds the position.")
    rotation_fixed: bool = key(False, "true: the block holds the angles.")
    play_position_m: NotNegative | None = key(None, "As in [rig.NAME], of this camera alone.", "m")
    play_rotation_deg: NotNegative | None = key(None, "As in [rig.NAME], of this camera alone.", "deg")
    drift_rotation_deg: Vector = key(
        (0.0, 0.0, 0.0),
        "Rotation from the first to the last exposure, about the axes of the reference camera; the true angles hold "
        "in the middle.",
        "deg",
    )

    @model_validator(mode="after")
    def _fixed_or_observed(self) -> MountingSpec:
        if (self.position_fixed and self.position_sigma_m) or (self.rotation_fixed and self.rotation_sigma_deg):
            raise ValueError("what is fixed has no σ")
        return self


class RigSpec(Table):
    """Cameras on one frame that are triggered together; the flight plan is that of the reference camera."""

    reference: Name = key(..., "Camera whose position and rotation are those of the rig.")
    camera: Annotated[dict[Name, MountingSpec], Field(min_length=1)] = key(
        ..., "The other cameras, one table [rig.NAME.camera.NAME] each."
    )
    constraint: Literal["rigid", "weighted", "off"] = key("rigid", "What the block states, as in block.toml.")
    tilt_deg: Vector = key(
        (0.0, 0.0, 0.0), "Angles omega, phi, kappa of the reference camera in a frame that looks straight down.", "deg"
    )
    play_position_m: NotNegative = key(0.0, "Standard deviation by which a camera moves between exposures.", "m")
    play_rotation_deg: NotNegative = key(0.0, "Standard deviation by which a camera turns between exposures.", "deg")


class SimulationSpec(Table):
    """A simulated block from flight plan to start values."""

    name: Name = key(..., "Name of the block.")
    rotation: Literal["omega-phi-kappa", "phi-omega-kappa"] = key(
        "omega-phi-kappa", "Order of the angles, as in block.toml."
    )
    camera: Annotated[dict[Name, CameraSpec], Field(min_length=1)] = key(
        ..., 'The cameras, one table [camera.NAME] each; preset = "ultracam_d", "dmc", "rmk_top_15" or "p1" takes a '
        "known one, whose keys need not be given."
    )  # fmt: skip
    flight: FlightSpec = key(..., "The flight plan: parallel strips, and cross strips.")
    terrain: TerrainSpec = key(TerrainSpec(), "The ground.")
    tie_points: TiePointSpec = key(..., "Tie points and their measurements.")
    control: ControlSpec = key(ControlSpec(), "Control and check points.")
    towers: TowerSpec | None = key(None, "Towers whose foot and top are measured; the block gets a condition for each.")
    gnss: GnssSpec | None = key(
        None, "Observed positions; shift and drift of every strip are drawn with their standard deviation."
    )
    ins: InsSpec | None = key(None, "Observed angles.")
    gross_errors: GrossErrorSpec | None = key(None, "Gross errors of tie points.")
    start_values: StartValueSpec = key(StartValueSpec(), "Start values of the orientation.")
    georeference: GeoreferenceSpec | None = key(None, "Where on Earth the flight takes place; a local block without.")
    photographs: PhotographSpec = key(PhotographSpec(), "How photographs are rendered.")
    adjustment: AdjustmentSpec = key(AdjustmentSpec(), "What block.toml shall say under [adjustment].")
    rig: dict[Name, RigSpec] = key(
        {}, 'Rigs: cameras on one frame, one table [rig.NAME] each; preset = "oblique_5" (a nadir and four oblique '
        'cameras), "two_head" or "large_format_4" takes a known one with its cameras.'
    )  # fmt: skip

    @model_validator(mode="before")
    @classmethod
    def _from_rig_presets(cls, data: Any) -> Any:
        return with_rig_presets(data) if isinstance(data, Mapping) and "rig" in data else data
