"""Two halves of a block adjusted apart and compared: the records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.observations import Camera

DIVISIONS: Mapping[str, str] = {
    "photographs": "alternate photographs of each strip",
    "strips": "alternate strips",
    "directions": "directions of flight",
    "time": "first and second half of the flight",
}
"""How a block is divided, with what that is in words."""


@dataclass(frozen=True)
class AgreementTest:
    """Whether differences are as large as their covariance says.

    Two tests look at the same differences z = δ/σ. The first weighs all combinations by their own σ, small-scale ones
    as much as large-scale ones; the second is the plain mean of z², in which what is uncertain and common to many cells
    counts most: a block that bends.

    Parameters
    ----------
    statistic : δᵀC⁺δ/f, distributed as F with `freedom` and `redundancy` where the halves differ by noise alone.
    freedom : f, the rank of the covariance C. redundancy : of both halves together, from which σ̂0 is.
    p_statistic : probability of so large a statistic.
    rms_z : root mean square of z. p_rms : probability of so large a one, the correlations taken into account.
    alpha : probability below which the halves are said to differ.
    max_z : largest |z|. expected_max_z : mean of that by noise alone, the correlations taken into account;
        usual_max_z : exceeded by noise alone in one case of twenty.
    """

    statistic: float
    freedom: int
    redundancy: float
    p_statistic: float
    rms_z: float
    p_rms: float
    alpha: float
    max_z: float
    expected_max_z: float
    usual_max_z: float

    @property
    def p(self) -> float:
        """Probability of both tests together: twice the smaller one."""
        return min(1.0, 2.0 * min(self.p_statistic, self.p_rms))

    @property
    def differs(self) -> bool:
        """Whether the halves differ by more than noise."""
        return self.p < self.alpha

    @property
    def is_too_close(self) -> bool:
        """Whether the halves agree better than independent errors of this σ̂0 would."""
        return 2.0 * (1.0 - max(self.p_statistic, self.p_rms)) < self.alpha

    @property
    def factor(self) -> float:
        """By how much the differences exceed what σ says: RMS of z, or √statistic where that is larger."""
        return max(self.rms_z, float(np.sqrt(self.statistic)))


@dataclass(frozen=True, eq=False)
class FieldDifference:
    """Image errors of the first half less those of the second, without what the orientation takes.

    Parameters
    ----------
    camera, group : of the photographs.
    x, y : (ny, nx) mm from the image centre. d, sigma : (ny, nx, 2) mm. test : over all cells together.
    """

    camera: Camera
    group: str
    x: np.ndarray
    y: np.ndarray
    d: np.ndarray
    sigma: np.ndarray
    test: AgreementTest

    @property
    def z(self) -> np.ndarray:
        """(ny, nx, 2) d/σ, 0 where neither half can differ."""
        return np.divide(self.d, self.sigma, out=np.zeros_like(self.d), where=self.sigma > 0.0)

    @property
    def rms(self) -> float:
        """mm, root mean square length of the differences."""
        return float(np.sqrt(np.mean(np.sum(self.d**2, axis=-1))))

    @property
    def rms_sigma(self) -> float:
        """mm, the length that σ lets expect."""
        return float(np.sqrt(np.mean(np.sum(self.sigma**2, axis=-1))))


@dataclass(frozen=True, eq=False)
class ParameterDifference:
    """Shared parameters of the first half less those of the second: p of them.

    Parameters
    ----------
    names, groups : (p,) str. first, second, sigma : (p,), σ of the difference.
    interior : test of principal distance and principal point together, None where they are held.
    """

    names: np.ndarray
    groups: np.ndarray
    first: np.ndarray
    second: np.ndarray
    sigma: np.ndarray
    interior: AgreementTest | None = None

    @property
    def z(self) -> np.ndarray:
        """(p,) difference/σ; 0 where σ is 0."""
        d = self.first - self.second
        return np.divide(d, self.sigma, out=np.zeros_like(d), where=self.sigma > 0.0)


@dataclass(frozen=True, eq=False)
class PointDifference:
    """Ground points that both halves determine: first less second, P of them, in k cells in plan.

    Parameters
    ----------
    point : (P,) index into the block's points. xyz : (P, 3) m, of the result. d, sigma : (P, 3) m.
    cell : (P,) cell of every point, −1 in none. centre : (k, 2) m, middle of the cells. size : m, of a cell's side.
    count : (k,) points. mean, mean_sigma : (k, 3) m, weighted mean of the differences.
    plan, height : tests over the cells, with the joint covariance of all means.
    """

    point: np.ndarray
    xyz: np.ndarray
    d: np.ndarray
    sigma: np.ndarray
    cell: np.ndarray
    centre: np.ndarray
    size: float
    count: np.ndarray
    mean: np.ndarray
    mean_sigma: np.ndarray
    plan: AgreementTest
    height: AgreementTest

    @property
    def z(self) -> np.ndarray:
        """(k, 3) mean/σ of the cells."""
        return np.divide(self.mean, self.mean_sigma, out=np.zeros_like(self.mean), where=self.mean_sigma > 0.0)

    def rms_z_of_points(self, axes: Sequence[int]) -> float:
        """RMS of difference/σ of single points along axes (0, 1, 2: X, Y, Z); 1 where σ is right."""
        d, sigma = self.d[:, axes], self.sigma[:, axes]
        return float(np.sqrt(np.mean((d[sigma > 0.0] / sigma[sigma > 0.0]) ** 2))) if (sigma > 0.0).any() else 0.0


@dataclass(frozen=True)
class HalfSummary:
    """One half: photographs and points adjusted, σ̂0, redundancy, and the photographs that hang loose in it."""

    photographs: int
    points: int
    sigma0: float
    redundancy: float
    loose: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class HalvesComparison:
    """Two halves adjusted apart and compared.

    Parameters
    ----------
    division : a key of `DIVISIONS`. same_as : an earlier division with the same halves, which stands for this one.
        halves : of the photographs, as they are named. reason : why the block cannot be
        divided so, '' where it can; then nothing else is known.
    summaries : of both halves. transformed : whether the ground points are compared after a transformation with seven
        parameters. sigma0 : of both halves together.
    fields : by group of photographs that has additional parameters in both halves. parameters, points : see there.
    notes : sentences on how it was done.
    """

    division: str
    halves: tuple[str, str] = ("", "")
    reason: str = ""
    same_as: str = ""
    summaries: tuple[HalfSummary, ...] = ()
    transformed: bool = False
    sigma0: float = float("nan")
    fields: tuple[FieldDifference, ...] = ()
    parameters: ParameterDifference | None = None
    points: PointDifference | None = None
    notes: tuple[str, ...] = ()

    @property
    def tests(self) -> tuple[tuple[str, AgreementTest], ...]:
        """Name and outcome of every test."""
        named = [(f"image errors {field.group}", field.test) for field in self.fields]
        if self.parameters is not None and self.parameters.interior is not None:
            named.append(("interior orientation", self.parameters.interior))
        if self.points is not None:
            named += [("ground points in plan", self.points.plan), ("ground points in height", self.points.height)]
        return tuple(named)

    @property
    def differs(self) -> bool:
        """Whether any test says that the halves differ by more than noise."""
        return any(test.differs for _, test in self.tests)


@dataclass(frozen=True, eq=False)
class HalvesRecord:
    """All divisions of a block.

    Parameters
    ----------
    block : its name. comparisons : a division each. alpha : of every test. robust : the estimator whose weights stay.
    """

    block: str
    comparisons: tuple[HalvesComparison, ...]
    alpha: float
    robust: str

    @property
    def found(self) -> tuple[str, ...]:
        """The divisions whose halves differ."""
        return tuple(one.division for one in self.comparisons if one.differs)

    @property
    def compared(self) -> tuple[str, ...]:
        """The divisions that were possible."""
        return tuple(one.division for one in self.comparisons if not (one.reason or one.same_as))
