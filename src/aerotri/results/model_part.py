"""The model part of σ: what the observations themselves show beyond white noise; of a result."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

GROUPS, FIELD = "groups", "field"
"""Where the model part is from: the differences of many groups, or random fields of few."""


@dataclass(frozen=True)
class ClusterTest:
    """Whether the errors of clusters of photographs are larger than the rays' noise can explain.

    Parameters
    ----------
    scheme : how the photographs were divided, such as 'strip'. clusters : how many there are.
    freedom : degrees of freedom of the test.
    ratio : how many times as large as the noise of the rays explains the clusters' common errors are (RMS, along the
        weakest deformations of the block). ratio_random : the same of random divisions into as many clusters.
    p_noise : probability of such a ratio by the noise of the rays alone. p_random : by what random divisions show. NaN
        where there was no test; those of random divisions as well where noise explains the ratio.
    counts : whether p_noise is below the level of the test, and p_random says that a group errs, not photographs.
    field_um, field_mm : σ and correlation length of the random field of every cluster; NaN where there was none.
    reason : why there was no test, '' otherwise.
    """

    scheme: str
    clusters: int
    freedom: int = 0
    ratio: float = float("nan")
    ratio_random: float = float("nan")
    p_noise: float = float("nan")
    p_random: float = float("nan")
    counts: bool = False
    reason: str = ""
    field_um: float = float("nan")
    field_mm: float = float("nan")


@dataclass(frozen=True, eq=False)
class ModelRoot:
    """k columns F of what groups of photographs do to the unknowns, rows as in `Unknowns`, in the frame there.

    F·Fᵀ less `noise` times the cofactors that come from the photographs is the model part of the covariance.

    Parameters
    ----------
    images : (n, 6, k) of centre and rotation unknowns. shared : (s, k). points : (P, 3, k) m, in single precision.
    noise : σ̂0², widened as F·Fᵀ is, where this contains the noise of the rays, 0 where it does not.
    beside : columns without noise of another cause; None where there are none.
    """

    images: np.ndarray
    shared: np.ndarray
    points: np.ndarray
    noise: float
    beside: ModelRoot | None = None

    @property
    def parts(self) -> tuple[ModelRoot, ...]:
        """Roots of one cause each, whose model parts add up."""
        own = () if not self.shared.shape[1] else (replace(self, beside=None),)
        return own if self.beside is None else (*own, *self.beside.parts)


LEAST_DIFFERENCE = 1.0
"""Difference of heights, or in plan, over their σ (RMS of the points) from which another set of parameters counts [C].
In simulated blocks errors over σ were smaller than 1 below it, where there is nothing to add, and larger than 1 above.
"""


@dataclass(frozen=True)
class OtherSet:
    """A set of additional parameters that the choice could not tell from the one it took.

    Parameters
    ----------
    set : its name. weight : probability that it predicts better than the one taken.
    plan_m, height_m : RMS over the points of the difference of the object. plan_sigma, height_sigma : of the
        difference over the σ of the noise, RMS.
    unexplained : share of the squares of the differences that the σ of the two sets do not explain.
    """

    set: str
    weight: float
    plan_m: float = float("nan")
    height_m: float = float("nan")
    plan_sigma: float = float("nan")
    height_sigma: float = float("nan")
    unexplained: float = 0.0

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> OtherSet:
        """From JSON, null of what is not known."""
        values: dict[str, Any] = {key: float("nan") if value is None else value for key, value in content.items()}
        return cls(**values)

    @property
    def share(self) -> float:
        """Of the squares of the differences that counts in total σ."""
        counts = max(self.plan_sigma, self.height_sigma) > LEAST_DIFFERENCE
        return self.weight * self.unexplained if counts else 0.0


@dataclass(frozen=True, eq=False)
class SetDifference:
    """How the unknowns differ between the set of additional parameters that was taken and another one.

    Parameters
    ----------
    other : what is told of it.
    images : (n, 6) of centre and rotation unknowns. shared : (s,). points : (P, 3) m; rows as in `Unknowns`, in the
        frame there.
    """

    other: OtherSet
    images: np.ndarray
    shared: np.ndarray
    points: np.ndarray

    @property
    def root(self) -> ModelRoot:
        """Its part of the model part of σ."""
        size = float(np.sqrt(self.other.share))
        points = (size * self.points[..., None]).astype(np.float32)
        return ModelRoot(size * self.images[..., None], size * self.shared[:, None], points, 0.0)


@dataclass(frozen=True)
class ControlEvidence:
    """What the residuals of control points say of σ and of the model part.

    Parameters
    ----------
    coordinates : of control points looked at. freedom : of the contradictions among them and with the photographs.
    ratio : RMS of the contradictions over what the noise explains, about 1 if σ is right. p : probability of a larger
        one. ratio_total, p_total : the same with the model part.
    left_out : RMS of the misses of control points, each left out in turn, over their σ. left_out_total : over total σ.
    scale : what control points say the variances of the model part should be multiplied with, 1 without a model part.
    """

    coordinates: int
    freedom: int = 0
    ratio: float = float("nan")
    p: float = float("nan")
    ratio_total: float = float("nan")
    p_total: float = float("nan")
    left_out: float = float("nan")
    left_out_total: float = float("nan")
    scale: float = 1.0


@dataclass(frozen=True)
class CommonPart:
    """A part of σ of the object points: what all have in common, or what is local.

    Parameters
    ----------
    part : such as 'height: tilt'. sigma_m, total_m : RMS over the points of the σ of the noise, and in total.
    """

    part: str
    sigma_m: float
    total_m: float


@dataclass(frozen=True)
class ModelPart:
    """What the model part of σ was derived from.

    Parameters
    ----------
    scheme : of the clusters whose excess is the model part, '' where none counts.
    clusters : their number. method : GROUPS where σ is from the clusters themselves, FIELD where they are too few and a
        random field of each stands for them. level : of the test.
    tests : of all schemes.
    ratio_plan, ratio_height : median of σ total over σ of the object points, 1 where nothing adds to σ.
    reason : why no clusters add to σ, '' where they do; another set may add to it all the same.
    control : what control points say; None where there are none. common : the parts of σ of the points.
    other_set : parameters that predict as well as those taken and give another object; None where there are none.
    """

    scheme: str = ""
    clusters: int = 0
    method: str = ""
    level: float = float("nan")
    tests: tuple[ClusterTest, ...] = ()
    ratio_plan: float = 1.0
    ratio_height: float = 1.0
    reason: str = ""
    control: ControlEvidence | None = None
    common: tuple[CommonPart, ...] = ()
    other_set: OtherSet | None = None

    @property
    def counts(self) -> bool:
        """Whether there is a model part."""
        return bool(self.scheme)

    @property
    def change(self) -> str:
        """How the errors change, such as 'from strip to strip'; '' where there is no model part."""
        if not self.scheme:
            return ""
        if self.clusters == 1:
            return "with the position in the image"
        with_direction = self.scheme.startswith("direction of ")
        return f"with the {self.scheme}" if with_direction else f"from {self.scheme} to {self.scheme}"

    def as_dict(self) -> dict[str, Any]:
        """For JSON; None for what is not known."""

        def plain(value: Any) -> Any:
            return None if isinstance(value, float) and not np.isfinite(value) else value

        own = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}

        def plain_keys(record: Any) -> dict[str, Any]:
            return {key: plain(value) for key, value in dataclasses.asdict(record).items()}

        own["tests"] = [plain_keys(test) for test in self.tests]
        own["common"] = [plain_keys(part) for part in self.common]
        own["control"] = None if self.control is None else plain_keys(self.control)
        own["other_set"] = None if self.other_set is None else plain_keys(self.other_set)
        return {key: plain(value) for key, value in own.items()}
