"""The spec of a simulation: what `simulation.toml` may say, checked key by key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from aerotri.conventions import LARGEST
from aerotri.simulation.presets import PRESETS

Number = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, gt=0.0, le=LARGEST, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(strict=True, ge=0.0, le=LARGEST, allow_inf_nan=False)]
Lap = Annotated[float, Field(strict=True, ge=0.0, le=0.95)]
Share = Annotated[float, Field(strict=True, ge=0.0, le=1.0)]
Probability = Annotated[float, Field(strict=True, gt=0.0, le=1.0)]
Count = Annotated[int, Field(strict=True, ge=1, le=2**31 - 1)]
Number0 = Annotated[int, Field(strict=True, ge=0, le=2**63 - 1)]
Name = Annotated[str, StringConstraints(min_length=1)]
InteriorName = Literal["focal_length_mm", "x0_mm", "y0_mm"]
BrownName = Literal["K1", "K2", "K3", "P1", "P2", "b1", "b2"]
LensName = Literal["k1", "k2", "p1", "p2", "k3"]
Triple = tuple[NotNegative, NotNegative, NotNegative]
Vector = tuple[Number, Number, Number]


class Table(BaseModel):
    """A table of the spec: unknown keys are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class PriorSpec(Table):
    """What the block says of an unknown beforehand; without a value the camera's own."""

    value: Number | None = None
    sigma: Positive | None = None
    fixed: bool = False


class PhysicalErrorSpec(Table):
    """Image errors from the physics of the camera.

    `rms_um` is the RMS of a coordinate of the error over the format. `weights` sets the relative sizes of the causes
    (see `camera_errors`), `seed` fixes the camera while the seed of the simulation changes.
    """

    rms_um: Positive
    day_change_um: NotNegative = 0.0
    seed: Number0 | None = None
    weights: dict[str, NotNegative] = {}


class ErrorSpec(Table):
    """What is wrong with a camera. `interior` is true minus calibrated; `parameters` by name, 'bluh.1'."""

    parameters: dict[str, Number] = {}
    brown: dict[BrownName, Number] = {}
    lens: dict[LensName, Number] = {}
    interior: dict[InteriorName, Number] = {}
    physical: PhysicalErrorSpec | None = None


class CameraSpec(Table):
    """A camera as block.toml has it, and its errors."""

    model: Literal["frame", "ultracam_d", "dmc"] = "frame"
    size_px: tuple[Count, Count]
    pixel_um: Positive
    focal_length_mm: Positive
    principal_point_mm: tuple[Number, Number] = (0.0, 0.0)
    flight_axis: Literal["+x", "-x", "+y", "-y"] = "+y"
    interior: dict[InteriorName, PriorSpec] = {}
    brown: dict[BrownName, PriorSpec] = {}
    lens: dict[LensName, PriorSpec] = {}
    errors: ErrorSpec = ErrorSpec()

    @model_validator(mode="before")
    @classmethod
    def _from_preset(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or "preset" not in data:
            return data
        own = dict(data)
        name = own.pop("preset")
        if not isinstance(name, str) or name not in PRESETS:
            raise ValueError(f"preset '{name}' is not known; known are {', '.join(PRESETS)}")
        return {**PRESETS[name], **own}


class CrossStripSpec(Table):
    """A strip across the others; `position` 0–1 along them. Without `images` it spans the outer strip axes."""

    position: Share = 0.5
    images: Count | None = None
    end_lap: Lap | None = None
    camera: str | None = None
    day: Count | None = None


class FlightSpec(Table):
    """The flight plan: parallel strips at a constant height above the mean ground, and cross strips.

    `heading_deg` clockwise from grid north; `area_m` (along, across) is covered by models throughout. Several
    `cameras` or `days` share the strips in runs of equal number.
    """

    gsd_m: Positive | None = None
    height_m: Positive | None = None
    area_m: tuple[Positive, Positive] | None = None
    strips: Count | None = None
    images_per_strip: Count | None = None
    end_lap: Lap = 0.6
    side_lap: Lap = 0.3
    heading_deg: Number = 90.0
    centre_m: tuple[Number, Number] = (0.0, 0.0)
    alternating: bool = True
    cross_strips: tuple[CrossStripSpec, ...] = ()
    attitude_sigma_deg: Triple = (0.0, 0.0, 0.0)
    position_sigma_m: Triple = (0.0, 0.0, 0.0)
    cameras: tuple[str, ...] = ()
    days: Count | None = None
    speed_m_s: Positive = 70.0
    turn_s: NotNegative = 240.0

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

    `houses` have flat roofs: middle X and Y from the middle of the block, size along X and along Y, height, m.
    """

    kind: Literal["flat", "undulating", "hill"] = "flat"
    height_m: Number = 0.0
    relief_rms_m: NotNegative = 0.0
    wavelength_m: Positive = 1000.0
    hill_height_m: Number = 0.0
    hill_radius_m: Positive = 100.0
    hill_centre_m: tuple[Number, Number] = (0.0, 0.0)
    houses: tuple[tuple[Number, Number, Positive, Positive, Positive], ...] = ()


class TiePointSpec(Table):
    """Tie points. `rays_per_point` sets the probability of a point being measured in an image that sees it.

    'clusters': around the nodes of a `pattern` (along, across) in every image, `cluster_sigma` in units of the format;
    'nodes': the same, with a point at every node of every image before any node has its second;
    'uniform': evenly over the ground.
    """

    per_image: Positive
    rays_per_point: Annotated[float, Field(strict=True, ge=2.0)] | None = None
    probability: Probability | None = None
    min_rays: Annotated[int, Field(strict=True, ge=1)] = 2
    max_rays: Annotated[int, Field(strict=True, ge=2)] | None = None
    distribution: Literal["uniform", "clusters", "nodes"] = "uniform"
    pattern: tuple[Count, Count] = (3, 3)
    cluster_sigma: Positive = 0.04
    sigma_um: NotNegative
    stated_sigma_um: Positive | None = None
    margin_px: NotNegative = 20.0

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

    point: Name
    error_m: Vector


class ControlSpec(Table):
    """Signalised points. The control is a grid, its mesh `distance_bases` base lengths of `base_end_lap`, or lies at
    `positions` (along, across; 0–1 of the block); check points are scattered between. σ = 0 means free of error: the
    block then states `stated_sigma_m`.
    """

    distance_bases: Positive | None = None
    base_end_lap: Lap = 0.6
    interior: bool = True
    positions: tuple[tuple[Number, Number], ...] = ()
    sigma_m: Triple = (0.03, 0.03, 0.03)
    stated_sigma_m: tuple[Positive, Positive, Positive] | None = None
    image_sigma_um: NotNegative | None = None
    check_points: Number0 = 0
    check_sigma_m: Triple | None = None
    blunders: tuple[ControlBlunderSpec, ...] = ()

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

    height_m: Positive
    per_image: Count = 1
    sigma_m: Positive = 0.01


class GnssSpec(Table):
    """Antenna positions; shift and drift of every strip are drawn with their σ."""

    sigma_m: tuple[Positive, Positive, Positive]
    shift_sigma_m: Triple = (0.0, 0.0, 0.0)
    drift_sigma_m_s: Triple = (0.0, 0.0, 0.0)
    lever_arm_m: Vector = (0.0, 0.0, 0.0)


class InsSpec(Table):
    """Attitudes (ω, φ, κ); `boresight_deg` turns the INS into the camera."""

    sigma_deg: tuple[Positive, Positive, Positive]
    boresight_deg: Vector = (0.0, 0.0, 0.0)


class GrossErrorSpec(Table):
    """Gross errors of tie points: a share of the rays, uniform in size, in a random direction."""

    fraction: Annotated[float, Field(strict=True, ge=0.0, lt=1.0)]
    range_sigma: tuple[NotNegative, Positive] = (10.0, 100.0)

    @model_validator(mode="after")
    def _ordered(self) -> GrossErrorSpec:
        if self.range_sigma[0] > self.range_sigma[1]:
            raise ValueError("range_sigma must rise")
        return self


class StartValueSpec(Table):
    """Start values of the orientation: none, or the truth with errors of these σ."""

    kind: Literal["none", "perturbed"] = "none"
    position_sigma_m: NotNegative = 1.0
    angle_sigma_deg: NotNegative = 0.1


class GeoreferenceSpec(Table):
    """Where on Earth the flight takes place: coordinates of the block in the CRS, `origin` there of its (0, 0, 0).

    Heights count from the ellipsoid where the CRS has no vertical part.
    """

    crs: str
    origin: Vector


class PhotographSpec(Table):
    """Photographs that are rendered: TIFF of 16 bits, or JPEG of 8 bits with EXIF as a drone writes it.

    `targets` draws bright discs at control and check points.
    """

    format: Literal["tiff", "jpeg"] = "tiff"
    targets: bool = False


class AdjustmentSpec(Table):
    """What block.toml shall say under `[adjustment]`."""

    additional_parameters: tuple[str, ...] = ()
    parameter_groups: str = "camera"


class SimulationSpec(Table):
    """A simulated block from flight plan to start values."""

    name: Name
    rotation: Literal["omega-phi-kappa", "phi-omega-kappa"] = "omega-phi-kappa"
    camera: Annotated[dict[Name, CameraSpec], Field(min_length=1)]
    flight: FlightSpec
    terrain: TerrainSpec = TerrainSpec()
    tie_points: TiePointSpec
    control: ControlSpec = ControlSpec()
    towers: TowerSpec | None = None
    gnss: GnssSpec | None = None
    ins: InsSpec | None = None
    gross_errors: GrossErrorSpec | None = None
    start_values: StartValueSpec = StartValueSpec()
    georeference: GeoreferenceSpec | None = None
    photographs: PhotographSpec = PhotographSpec()
    adjustment: AdjustmentSpec = AdjustmentSpec()
