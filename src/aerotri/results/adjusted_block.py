"""The result of an adjustment: everything a later stage, a table or a plot needs, as one frozen record of arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from aerotri.functional_model.additional_parameters import Parameter, is_grid
from aerotri.observations import Block
from aerotri.results.head import Head, now

if TYPE_CHECKING:
    from aerotri.results.common_motion import CommonMotion
    from aerotri.results.common_shift import CommonShift
    from aerotri.results.control_heights import ControlHeights
    from aerotri.results.deviations import Deviations
    from aerotri.results.model_part import ModelPart
    from aerotri.results.photograph_fields import PhotographFields
    from aerotri.results.position_errors import PositionErrors
    from aerotri.results.ray_correlation import RayCorrelation
    from aerotri.results.relative import RelativePrecision
    from aerotri.results.removal import Removal
    from aerotri.results.rigidity import Rigidity
    from aerotri.results.rigs import MountedCamera, RigMovements
    from aerotri.results.rolling_shutter import RollingShutters
    from aerotri.results.unmodelled_shutter import UnmodelledShutter
    from aerotri.results.variance_components import VarianceComponents


@dataclass(frozen=True, eq=False)
class Outcome:
    """How the adjustment ended.

    Parameters
    ----------
    status : 'converged', 'not converged' or 'rank deficient'.
    message : the status in words, naming the culprit; '' when converged.
    sigma0 : σ̂0, dimensionless; sigma0_um : the same times the a-priori σ of an image coordinate, µm.
    vtpv : vᵀPv with the final weights.
    observations, unknowns, conditions, redundancy : redundancy = observations − unknowns + conditions.
    warnings : sentences the user should read. notes : sentences about what the program chose by itself.
    verdict : 'accepted', 'doubtful' or 'rejected'; '' before it is judged. reasons : sentences, the gravest first.
    good_for : 'absolute', 'relative' or 'neither', '' where that is not known. purpose : the same in a sentence or two,
        with the numbers.
    timings_s : seconds by stage. computed : when.
    """

    status: str
    message: str
    iterations: int
    sigma0: float
    sigma0_um: float
    vtpv: float
    observations: int
    unknowns: int
    conditions: int
    redundancy: int
    warnings: tuple[str, ...] = ()
    timings_s: Mapping[str, float] = field(default_factory=dict)
    verdict: str = ""
    reasons: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    computed: datetime = field(default_factory=now)
    good_for: str = ""
    purpose: str = ""


@dataclass(frozen=True, eq=False)
class ImageResults:
    """Exterior orientation of the n photographs, in the block's object frame.

    Parameters
    ----------
    centre : (n, 3) m.
    angles : (n, 3) rad, ω, φ, κ in the block's order.
    covariance : (n, 6, 6) of (X0, Y0, Z0, ω, φ, κ), m and rad, σ̂0² included; NaN where not available.
    rays : (n,) rays used.
    model : (n, 6, 6) the model part of the covariance, see `statistics.model_part`; None where there is none.
    """

    centre: np.ndarray
    angles: np.ndarray
    covariance: np.ndarray
    rays: np.ndarray
    model: np.ndarray | None = None

    @property
    def sigma(self) -> np.ndarray:
        """(n, 6) m and rad, of the noise."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def total_covariance(self) -> np.ndarray:
        """(n, 6, 6), with the model part."""
        return self.covariance if self.model is None else self.covariance + self.model

    @property
    def total_sigma(self) -> np.ndarray:
        """(n, 6) m and rad, with the model part."""
        return np.sqrt(np.diagonal(self.total_covariance, axis1=1, axis2=2))


@dataclass(frozen=True, eq=False)
class PointResults:
    """The N object points of the block, NaN where a point could not be adjusted.

    Parameters
    ----------
    xyz : (N, 3) m.
    covariance : (N, 3, 3) m², σ̂0² included.
    rays : (N,) rays used.
    max_abs_w : (N,) largest |w| of the point's image coordinates.
    model : (N, 3, 3) m² the model part of the covariance, see `statistics.model_part`; None where there is none.
    """

    xyz: np.ndarray
    covariance: np.ndarray
    rays: np.ndarray
    max_abs_w: np.ndarray
    model: np.ndarray | None = None

    @property
    def sigma(self) -> np.ndarray:
        """(N, 3) m, of the noise."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def total_covariance(self) -> np.ndarray:
        """(N, 3, 3) m², with the model part."""
        return self.covariance if self.model is None else self.covariance + self.model

    @property
    def total_sigma(self) -> np.ndarray:
        """(N, 3) m, with the model part."""
        return np.sqrt(np.diagonal(self.total_covariance, axis1=1, axis2=2))


@dataclass(frozen=True, eq=False)
class RayResults:
    """Residuals of the m rays in the order of `block.image_points`, NaN where a ray was not used.

    Parameters
    ----------
    v : (m, 2) mm, adjusted minus measured.
    r : (m, 2) redundancy numbers.
    w : (m, 2) normalised residuals −v/(σ√r), σ a priori.
    weight : (m,) robust factor, 1 when off.
    status : (m,) `RayStatus`.
    """

    v: np.ndarray
    r: np.ndarray
    w: np.ndarray
    weight: np.ndarray
    status: np.ndarray


@dataclass(frozen=True, eq=False)
class RayEffects:
    """External reliability of the m rays: the greatest effect of errors that just stay undetected; see there.

    Parameters
    ----------
    size : (m, 2) of the effects of x and y, over σ of the unknown; NaN where there is no test.
    unknown : (m, 2) which: 0–2 X, Y, Z of the ray's point, 3–8 X0, Y0, Z0, ω, φ, κ of its photograph, 9 + k the shared
        parameter k, −1 for none.
    height : (m, 2) m, effect on Z of the ray's point.
    shared : (s,) str, the shared parameters.
    """

    size: np.ndarray
    unknown: np.ndarray
    height: np.ndarray
    shared: np.ndarray


@dataclass(frozen=True, eq=False)
class SharedParameters:
    """Unknowns shared by many rays: interior orientation, additional parameters, GNSS shifts; s of them.

    Parameters
    ----------
    names : (s,) str such as 'focal_length_mm', 'bluh.1', 'brown.K1', 'gnss.shift_X'.
    groups : (s,) str, the camera, day or strip the parameter belongs to.
    kinds : (s,) str, 'interior', 'additional', 'gnss', 'ins', 'rig' or 'rolling_shutter'.
    marks : (s,) str, P L D C of the family, '' otherwise.
    value : (s,); covariance : (s, s), σ̂0² included. Units: mm for interior elements, as the family states otherwise.
    max_correlation : (s,) the largest |r| with another shared parameter, signed; max_correlation_with : (s,) its name.
    total_correlation : (s,) B = 1 − 1/(N_ii·Q_ii) with N reduced to the shared parameters.
    status : (s,) str, 'estimated', 'weighted', 'fixed' or 'removed'; reason : (s,) str.
    model : (s, s) the model part of the covariance, see `statistics.model_part`; None where there is none.
    """

    names: np.ndarray
    groups: np.ndarray
    kinds: np.ndarray
    marks: np.ndarray
    value: np.ndarray
    covariance: np.ndarray
    max_correlation: np.ndarray
    max_correlation_with: np.ndarray
    total_correlation: np.ndarray
    status: np.ndarray
    reason: np.ndarray
    model: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.names)

    @property
    def sigma(self) -> np.ndarray:
        """(s,)."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def total_covariance(self) -> np.ndarray:
        """(s, s), with the model part."""
        return self.covariance if self.model is None else self.covariance + self.model

    @property
    def model_sigma(self) -> np.ndarray | None:
        """(s,) the model part of σ, None where there is none."""
        return None if self.model is None else np.sqrt(np.diagonal(self.model))

    @property
    def total_sigma(self) -> np.ndarray:
        """(s,), with the model part."""
        return np.sqrt(np.diagonal(self.total_covariance))

    @property
    def is_node(self) -> np.ndarray:
        """(s,) bool, nodes of a grid or random field: none says anything on its own."""
        return np.array([is_grid(Parameter.of(name).family) for name in self.names], dtype=bool)

    @property
    def t(self) -> np.ndarray:
        """(s,) |value|/σ."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.abs(self.value) / self.sigma


@dataclass(frozen=True, eq=False)
class GroundPointResults:
    """Control or check points, k of them; NaN in a coordinate that was not given.

    Parameters
    ----------
    point : (k,) index into the block's point names.
    difference : (k, 3) m, adjusted − given.
    sigma : (k, 3) m of the adjusted coordinate, σ̂0 included.
    r : (k, 3) redundancy numbers of the given coordinate (NaN for check points).
    w : (k, 3) normalised: control −v/(σ√r); check points d/√(σ_adjusted² + σ_given²).
    rays : (k,).
    lone_sigma : (k, 3) m, of coordinates that are held (σ = 0), a priori, as all others predict them; NaN elsewhere.
        Their r is 0, and w is (given − predicted)/lone_sigma: what −v/(σ√r) tends to with σ.
    freedom : (3,) degrees of freedom of X, Y, Z of check points, see `check_freedom`; None where not computed.
    model_sigma : (k, 3) m, the model part of σ of the adjusted coordinate; None where there is none.
    """

    point: np.ndarray
    difference: np.ndarray
    sigma: np.ndarray
    r: np.ndarray
    w: np.ndarray
    rays: np.ndarray
    lone_sigma: np.ndarray | None = None
    freedom: np.ndarray | None = None
    model_sigma: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.point)

    @property
    def total_sigma(self) -> np.ndarray:
        """(k, 3) m, of the adjusted coordinate with the model part."""
        return self.sigma if self.model_sigma is None else np.hypot(self.sigma, self.model_sigma)


@dataclass(frozen=True, eq=False)
class ObservationResults:
    """Observations beside image points and control, o of them: GNSS, INS, conditions; in the local frame.

    Parameters
    ----------
    group : (o,) str. label : (o,) str, the photograph or condition. component : (o,) str, such as X or omega.
    v, sigma : (o,) m, rad for attitudes; sigma a priori. r : (o,) redundancy numbers. w : (o,) −v/(σ√r).
    effect : (o,) greatest effect of an error that just stays undetected, over σ of the unknown; effect_on : (o,) str.
    """

    group: np.ndarray
    label: np.ndarray
    component: np.ndarray
    v: np.ndarray
    sigma: np.ndarray
    r: np.ndarray
    w: np.ndarray
    effect: np.ndarray | None = None
    effect_on: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.group)


@dataclass(frozen=True)
class ObservationGroup:
    """One group of observations: its share of the redundancy and how its residuals fit their σ.

    `sigma_apriori` and `rms` in the unit of the group (µm for image points, rad for attitudes, m otherwise);
    `sigma_aposteriori` is sigma_apriori·√(vᵀPv of the group / its redundancy).
    """

    name: str
    count: int
    sigma_apriori: float
    rms: float
    redundancy: float
    sigma_aposteriori: float


@dataclass(frozen=True)
class Blunder:
    """A suspected gross error in one image coordinate pair."""

    image: str
    point: str
    w: float
    estimated_mm: float
    action: str


@dataclass(frozen=True, eq=False)
class AdjustedBlock:
    """A block after its adjustment; what the later stages start from.

    `components` is there where `variance_components = "on"`: `block` then has the σ they led to. `removals` are those
    of the selection of additional parameters, in order; `parameters` has them too, behind the others. `model_part`
    says where the model part of σ comes from, or why there is none; None before it is looked for. `rigs` are the
    cameras of rigs beside their reference cameras, `rigidity` the tests whether they keep their places, `rig_movements`
    how they move on weighted rigs.
    `deviations` says how much parameters differ between groups of photographs that are tied to one another,
    `ray_correlation` how much neighbouring rays of a photograph err alike, `common_shift` what all observed positions
    are shifted against the control points, `common_motion` what they are turned and scaled,
    `photograph_fields` how much photographs have smooth errors of their own, `relative` the σ of the shape of the
    block, `control_heights` how the heights of all control points together fit; None where none of them stands out.
    `unmodelled_shutter` is what the photographs say of a rolling shutter that no camera states.
    """

    block: Block
    outcome: Outcome
    images: ImageResults
    points: PointResults
    rays: RayResults
    parameters: SharedParameters
    control: GroundPointResults
    check: GroundPointResults
    groups: tuple[ObservationGroup, ...]
    blunders: tuple[Blunder, ...] = ()
    observations: ObservationResults | None = None
    components: VarianceComponents | None = None
    effects: RayEffects | None = None
    removals: tuple[Removal, ...] = ()
    model_part: ModelPart | None = None
    deviations: Deviations | None = None
    position_errors: PositionErrors | None = None
    rigs: tuple[MountedCamera, ...] = ()
    rigidity: Rigidity | None = None
    rolling_shutters: RollingShutters | None = None
    rig_movements: RigMovements | None = None
    ray_correlation: RayCorrelation | None = None
    common_shift: CommonShift | None = None
    photograph_fields: PhotographFields | None = None
    relative: RelativePrecision | None = None
    common_motion: CommonMotion | None = None
    control_heights: ControlHeights | None = None
    unmodelled_shutter: UnmodelledShutter | None = None


def head_of(adjusted: AdjustedBlock) -> Head:
    """The head of pages and files about an adjustment."""
    return Head(adjusted.block.project, adjusted.block.crs, adjusted.outcome.computed)
