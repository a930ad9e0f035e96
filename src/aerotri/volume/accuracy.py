"""σ of a volume, every part named: adjustment, matching, interpolation, base, boundary; the systematic part apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from aerotri.conventions import in_digits
from aerotri.statistics.camera_field import known_field
from aerotri.volume.bases import Base, PlaneBase, SplineBase, Surface, integral_of_spline, quadrature_of
from aerotri.volume.boundary import Boundary
from aerotri.volume.drawn_edge import boundary_variance
from aerotri.volume.ground_around import ground_around
from aerotri.volume.parts import Part
from aerotri.volume.rectified import LINE, NO_LINE, Line
from aerotri.volume.regions import Region
from aerotri.volume.response import Systematic, systematic
from aerotri.volume.settings import SigmaOptions
from aerotri.volume.shared import (
    both_between,
    difference_part,
    same_adjustment,
    shared_camera_covariance,
    shared_control_covariance,
    shared_in_words,
    summed_part,
)

ALL_THE_SAME = 1.0 - 1e-9
"""Share of the heights of two surfaces that is in both from which they are one surface, but for rounding."""
PARTS = ("adjustment", "matching", "interpolation", "base", "boundary")
MOVES = "the boundary is taken as drawn on the surface: a shift or turn of the whole block moves both"
MODEL = "model"
"""The part beside these of image errors that photographs share: those of a group, and those that the additional
parameters leave in all photographs of a camera."""
LASTING = "matching_shared"
"""The part beside these of dense surfaces: errors of the matching that do not average out."""
BRIDGED = "bridged"
"""The part beside these of the ground of dense surfaces: errors of what is bridged below objects."""


@dataclass(frozen=True)
class SideSigma:
    """σ of a cut or of a fill, m³.

    Parameters
    ----------
    parts : as of `VolumeSigma`, and what moving the line between cut and fill does (`LINE`).
    beyond : m³ that it is expected to hold beyond that of the surface as given; not in the volume, its square in σ.
    """

    parts: dict[str, float]
    beyond: float

    @property
    def total(self) -> float:
        """m³, the root of the sum of squares."""
        return float(np.sqrt(sum(part**2 for part in self.parts.values())))

    @classmethod
    def of(cls, sigma: VolumeSigma | None, like: VolumeSigma) -> SideSigma:
        """From σ of the volume on one side, None where there is none; like : of the net volume."""
        if sigma is None:
            return cls(dict.fromkeys((*like.parts, LINE), 0.0), 0.0)
        curvature = 0.0 if sigma.curvature is None else sigma.curvature[0]
        return cls(sigma.parts | {LINE: sigma.parts.get(LINE, 0.0)}, curvature - sigma.noise_on_line)


@dataclass(frozen=True)
class VolumeSigma:
    """σ of a volume, m³.

    Parameters
    ----------
    parts : by the names of `PARTS`, perhaps `MODEL`, `LASTING` and `BRIDGED` too, each alone; interpolation holds the
        curvature.
    curvature : ground that straight lines between the heights are expected to leave out, m³ and its σ; not in the
        volume, None where not known.
    systematic : what uncorrected image errors add or would add.
    corrected : whether the photographs were corrected, so that the systematic part is none.
    pickets, rays : behind the adjustment's part. notes : how it was found, sentences.
    beside : those of the notes that are about base, boundary and ground.
    noise_on_line : m³, of a cut or a fill: what noise alone adds to it.
    sides : of the cut and of the fill; None where not asked for.
    """

    parts: dict[str, float]
    curvature: tuple[float, float] | None
    systematic: tuple[Systematic, ...]
    corrected: bool
    pickets: int
    rays: int
    notes: tuple[str, ...] = field(default=())
    beside: tuple[str, ...] = ()
    noise_on_line: float = 0.0
    sides: tuple[SideSigma, SideSigma] | None = None

    @property
    def total(self) -> float:
        """m³, the root of the sum of squares; systematic parts are not in it."""
        return float(np.sqrt(sum(part**2 for part in self.parts.values())))


@dataclass(frozen=True)
class StatedSigma:
    """What is stated about base and boundary makes of σ of a volume, m³; errors of the surface are not in it."""

    base: float
    boundary: float

    @property
    def total(self) -> float:
        """m³, the root of the sum of squares."""
        return float(np.hypot(self.base, self.boundary))


def stated_sigma(surface: Surface, base: Base, boundary: Boundary, options: SigmaOptions) -> StatedSigma:
    """Of a volume whose surface has no adjustment."""
    edge = boundary_variance(surface, base, boundary, options.boundary_sigma)
    return StatedSigma(options.base_sigma * boundary.area, float(np.sqrt(edge)))


def stated_sum(each: Sequence[StatedSigma]) -> StatedSigma:
    """Of several volumes: σ of the base is common to all, boundaries are each one's own."""
    return StatedSigma(sum(one.base for one in each), float(np.sqrt(sum(one.boundary**2 for one in each))))


def volume_sigma(
    surface: Surface, base: Base, boundary: Boundary, part: Part, base_part: Part | None, options: SigmaOptions
) -> VolumeSigma:
    """σ of a volume from the share of the surface and, where the base is a surface with an adjustment, of the base.

    Parameters
    ----------
    base_part : responses to the base's own volume, counted positive. What both were measured with counts once: one
        adjustment by the difference of the responses; control points and values of a camera that two adjustments
        share, by name and value, by their covariance.
    """
    region = part.region
    below = None if options.base_sigma > 0.0 else spline_variance(base, boundary, surface, region)
    stated = options.base_sigma * (boundary.area if region is None else region.area)
    ground = stated**2 if below is None else below
    sign = 0 if region is None else region.sign
    edge = boundary_variance(surface, base, boundary, options.boundary_sigma, sign, region)
    notes = _notes(part, base_part, base, below is not None, options)
    beside = _Beside(ground, edge, notes, region.line if region is not None and sign else None)
    return _assembled(part, base_part, beside, options)


@dataclass(frozen=True, eq=False)
class PileSigma:
    """What σ of a sum of volumes is made of: shares, area, m², and σ of one of them."""

    part: Part
    base_part: Part | None
    area: float
    sigma: VolumeSigma

    @property
    def line(self) -> Line | None:
        """Of a cut or a fill."""
        region = self.part.region
        return None if region is None or not region.sign else region.line

    @property
    def spread(self) -> float:
        """m, σ of the heights over the base that all places have in common."""
        parts = self.sigma.parts
        return float(np.hypot(parts["adjustment"], parts.get(MODEL, 0.0))) / max(self.area, 1e-300)


def sum_sigma(piles: Sequence[PileSigma], options: SigmaOptions) -> VolumeSigma:
    """σ of the sum of several volumes of one surface.

    The adjustment moves all of them: its part is that of one functional over the heights of all. The stated σ of the
    base is common to all; what is left of the base, ground between heights and boundaries are each pile's own.
    """
    bases = [one.base_part for one in piles if one.base_part is not None]
    part = summed_part([one.part for one in piles], options.corrected)
    base_part = summed_part(bases, options.corrected) if bases else None
    own = sum(one.sigma.parts["base"] ** 2 - (options.base_sigma * one.area) ** 2 for one in piles)
    ground = max(own, 0.0) + (options.base_sigma * sum(one.area for one in piles)) ** 2
    edge = sum(one.sigma.parts["boundary"] ** 2 for one in piles)
    notes = dict.fromkeys(text for one in piles for text in one.sigma.beside)
    lines = [one.line for one in piles if one.line is not None]
    line = sum(lines, NO_LINE) if lines else None
    return _assembled(part, base_part, _Beside(ground, edge, tuple(notes), line), options)


@dataclass(frozen=True)
class _Beside:
    """What does not come from the measurements: variances of base and boundary, m⁶, and sentences.

    line : between cut and fill, of one of them.
    """

    ground: float
    edge: float
    notes: tuple[str, ...]
    line: Line | None = None


def _assembled(part: Part, base_part: Part | None, beside: _Beside, options: SigmaOptions) -> VolumeSigma:
    """All parts together."""
    both, shared, said = [part] if base_part is None else [part, base_part], 0.0, []
    lasting, bridged = sum(one.lasting_variance for one in both), sum(one.bridged_variance for one in both)
    of_side = beside.line is not None
    if base_part is not None and same_adjustment(part, base_part):
        joint, once = difference_part(part, base_part, options.corrected, of_side)
        both, said, lasting = [joint], [_one_adjustment(once)], lasting * (1.0 - once)
        bridged = 0.0 if once > ALL_THE_SAME else bridged
    elif base_part is not None:
        shared = shared_control_covariance(part, base_part) + shared_camera_covariance(part, base_part)
        said = [shared_in_words(part, base_part)]
    adjustment = sum(one.response.variance for one in both) - 2.0 * shared
    between = both_between([(one.between, 1.0) for one in both], of_side)
    parts = {
        "adjustment": np.sqrt(max(adjustment, 0.0)),
        "matching": np.sqrt(sum(one.response.noise for one in both)),
        "interpolation": np.sqrt(0.0 if between is None else between.mean_square),
        "base": np.sqrt(beside.ground),
        "boundary": np.sqrt(beside.edge),
    }
    if any(one.calibration.model is not None or one.response.model > 0.0 for one in both):
        parts = {"adjustment": parts["adjustment"], MODEL: np.sqrt(sum(one.response.model for one in both))} | parts
        said += [_model_in_words(one, parts) for one in both if one.response.model > 0.0]
    if any(one.lasting.sigma_m > 0.0 for one in (part, base_part) if one is not None):
        parts[LASTING] = np.sqrt(lasting)
    if any(one.bridged is not None for one in (part, base_part) if one is not None):
        parts[BRIDGED] = np.sqrt(bridged)
    if beside.line is not None:
        parts[LINE] = np.sqrt(beside.line.mean_square)
    first = both[0]
    found = tuple(systematic(first.calibration, first.response, variant) for variant in ("free", "absorbed")
                  if len(first.response.by_parameters))  # fmt: skip
    return VolumeSigma(
        {name: float(value) for name, value in parts.items()},
        None if between is None else (between.curvature, float(np.sqrt(between.variance))), found, options.corrected,
        sum(one.pickets for one in both), sum(one.rays for one in both), (*said, *beside.notes), beside.notes,
        0.0 if beside.line is None else beside.line.noise,
    )  # fmt: skip


def _one_adjustment(once: float) -> str:
    """What two surfaces of one adjustment share, in words."""
    said = "surface and base come from one adjustment: the errors that both share cancel"
    if once > ALL_THE_SAME:
        return f"{said}; all heights are the same measurements"
    if once > 0.0:
        said += f", among them those of {in_digits(100.0 * once, 3)} % of the area, which has the same heights in both"
    return f"{said}; matching and interpolation are taken for independent where the heights differ"


def _model_in_words(part: Part, parts: dict[str, float]) -> str:
    """Why σ is larger than the noise makes it."""
    found = part.calibration.local.model_part
    change, other = ("", None) if found is None else (found.change, found.other_set)
    noise, total = parts["adjustment"], np.hypot(parts["adjustment"], parts[MODEL])
    reasons = []
    if change:
        reasons.append(f"the errors of the photographs change {change}, more than noise explains")
    elif known_field(part.calibration) is not None:
        reasons.append("the residuals show image errors that the additional parameters leave")
    if other is not None and other.share > 0.0:
        reasons.append(f"the image points cannot tell the additional parameters from {other.set}")
    why = ", and ".join(reasons)
    if in_digits(total, 2) == in_digits(noise, 2):
        return f"{why}: with this model part the adjustment's share of σ stays {in_digits(total, 2)} m³"
    return (
        f"{why}: with this model part the adjustment's share of σ is {in_digits(total, 2)} m³ instead of "
        f"{in_digits(noise, 2)} m³"
    )


def spline_variance(base: Base, boundary: Boundary, surface: Surface, region: Region | None = None) -> float | None:
    """m⁶, of what a spline leaves out of the ground below it, from the ground around.

    None where the base is no spline, or too little ground is known around it.

    Parameters
    ----------
    region : what counts of the boundary; None: all.
    """
    if not isinstance(base, SplineBase):
        return None
    around = ground_around(base, boundary, surface)
    if around is None:
        return None
    places, weight = quadrature_of(boundary) if region is None else (region.places, region.weight)
    integral = base.integral if region is None else integral_of_spline(base, places, weight)
    return around.contrast_variance(np.concatenate([places, base.xy]), np.concatenate([weight, -integral]))


def _notes(part: Part, base_part: Part | None, base: Base, judged: bool, options: SigmaOptions) -> tuple[str, ...]:
    notes = []
    if part.unseen > 0.0:
        unseen = f"{in_digits(part.unseen, 4)} m² are seen by too few photographs of the block"
        notes.append(f"{unseen} and are not included in σ")
    if part.between is None:
        notes.append("too few heights to tell how rough the ground is: interpolation is left out")
    if base_part is None and not isinstance(base, PlaneBase | SplineBase) and options.base_sigma <= 0.0:
        notes.append("the base counts as free of error: give its σ with --base-adjustment or --base-sigma")
    if isinstance(base, SplineBase) and options.base_sigma <= 0.0:
        said = (
            "σ of the base is estimated from the ground outside the boundary and holds where the ground below is of "
            "the same kind; if you know that ground better, give --base-sigma or a surveyed base"
        )
        few = "too little ground outside the boundary to judge the base by: state --base-sigma"
        notes.append(said if judged else few)
    if isinstance(base, PlaneBase) and base.nodes is None and options.base_sigma <= 0.0:
        notes.append(f"the base ({base.name}) counts as free of error: give its σ with --base-sigma")
    if options.boundary_from == "product":
        notes.append(MOVES)
    if options.boundary_sigma <= 0.0:
        notes.append("the boundary counts as free of error: give its σ with --boundary-sigma")
    return tuple(notes)
