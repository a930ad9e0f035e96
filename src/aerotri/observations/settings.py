"""The settings of a block that are no measurements, as block.toml states them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class AdjustmentSettings:
    """What `[adjustment]` of block.toml says; what every key means is said in `formats.block.settings_model`.

    Parameters
    ----------
    additional_parameters : (family, items) pairs, for example (('bluh', ('1', '2')), ('ultracam_d', ('42',))).
    parameter_groups : 'camera', 'block' or a grouping column of the images.
    datum_points : names of the points that carry an inner datum; empty = all.
    parameters_removed : (name, group) pairs of additional parameters that the selection took out.
    datum_fixed : orientation elements held when datum = 'fixed': (image name, element) pairs, element one of
        X0 Y0 Z0 omega phi kappa.
    """

    additional_parameters: tuple[tuple[str, tuple[str, ...]], ...] = ()
    parameter_groups: str = "camera"
    parameter_position: str = "adjusted"
    parameter_selection: str = "off"
    t_limit: float = 1.0
    correlation_limit: float = 0.85
    parameters_removed: tuple[tuple[str, str], ...] = ()
    robust: str = "off"
    datum: str = "control"
    datum_points: tuple[str, ...] = ()
    datum_fixed: tuple[tuple[str, str], ...] = ()
    variance_components: str = "off"
    model_part: str = "on"
    start: str = "auto"
    alpha: float = 0.001
    power: float = 0.80
    max_iterations: int = 30

    @property
    def is_free(self) -> bool:
        """Whether control is compared only, and what the observations leave free is fixed by a datum of its own."""
        return self.datum in ("minimal", "inner")


@dataclass(frozen=True)
class GnssSettings:
    """What `[gnss]` says. `lever_arm_m` runs from the projection centre to the antenna, in the camera frame.

    Parameters
    ----------
    correlated : 'on' where positions have errors that stay for a while.
    correlation_time_s : τ of these errors, correlated_sigma_m : their σ of X, Y, Z; None: estimated from the block.
    noise_factor : of the σ of the table, in plan and in height; None: estimated.
    """

    shift: str = "off"
    drift: str = "off"
    lever_arm_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lever_arm_sigma_m: tuple[float, float, float] | None = None
    time_offset: str = "off"
    correlated: str = "off"
    correlation_time_s: float | None = None
    correlated_sigma_m: tuple[float, float, float] | None = None
    noise_factor: tuple[float, float] | None = (1.0, 1.0)

    @property
    def to_estimate(self) -> bool:
        """Whether errors that stay for a while are asked for and not known in full."""
        known = self.correlation_time_s, self.correlated_sigma_m, self.noise_factor
        return self.correlated == "on" and None in known


@dataclass(frozen=True)
class InsSettings:
    """What `[ins]` says."""

    boresight: str = "camera"
    drift: str = "off"


@dataclass(frozen=True)
class CollocationSettings:
    """What `[collocation]` says of the image error as a random field; None: estimated from the block.

    Parameters
    ----------
    sigma_um : σ_d of the field, as a weight beside the a-priori σ of the image coordinates.
    length_mm : correlation length in the image.
    """

    sigma_um: float | None = None
    length_mm: float | None = None


@dataclass(frozen=True)
class PhotographFieldSettings:
    """What `[stochastic]` says of smooth errors of single photographs; None: estimated from the block.

    Parameters
    ----------
    correlated : 'on' where the image points of a photograph have such errors in common.
    sigma_um : of the error, as a weight beside the a-priori σ of the image coordinates.
    length_mm : correlation length in the image.
    """

    correlated: str = "off"
    sigma_um: float | None = None
    length_mm: float | None = None

    @property
    def is_given(self) -> bool:
        """Whether nothing is left to estimate."""
        return None not in (self.sigma_um, self.length_mm)


@dataclass(frozen=True)
class DeviationSettings:
    """What `[deviations]` says of additional parameters that have values in several groups.

    Parameters
    ----------
    kind : 'free', 'independent' or 'walk'.
    sigma_um : σ of the deviations by parameter, as an image error; None: estimated from the block.
    """

    kind: str = "free"
    sigma_um: Mapping[str, float] | None = None


@dataclass(frozen=True)
class Settings:
    """All settings of a block that are not measurements."""

    adjustment: AdjustmentSettings = AdjustmentSettings()
    gnss: GnssSettings = GnssSettings()
    ins: InsSettings = InsSettings()
    collocation: CollocationSettings = CollocationSettings()
    deviations: DeviationSettings = DeviationSettings()
    photograph_fields: PhotographFieldSettings = PhotographFieldSettings()
    image_sigma_um: float = 1.0
    refraction: str = "off"
    earth_curvature: str = "off"
