"""What a cross-check found: differences against σ, and the verdict. A difference is peer − ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

LIMIT = 0.05
"""Largest |Δ|/σ that counts as agreement."""
VTPV_LIMIT = 1e-9
"""Largest relative difference of vᵀPv that counts as agreement."""
COVARIANCE_LIMIT = 1e-3
"""Largest relative difference of a σ, and largest difference of a correlation, that counts as agreement."""

PATTERN_LIMIT = 1e-9
"""Largest difference of a pattern, of its largest value, that counts as the same formula: rounding is below 1e-12."""


@dataclass(frozen=True, eq=False)
class Difference:
    """The differences of one kind of unknowns against our σ.

    Parameters
    ----------
    kind : such as 'object points'. worst : name of the unknown that differs most.
    normalised : (k,) |Δ|/σ of every unknown of the kind that has a σ; ∞ where the peer has no number.
    """

    kind: str
    worst: str
    normalised: np.ndarray

    @property
    def count(self) -> int:
        return len(self.normalised)

    @property
    def max(self) -> float:
        return float(self.normalised.max())

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.normalised**2)))


def difference(kind: str, delta: np.ndarray, sigma: np.ndarray, names: np.ndarray, axes: tuple[str, ...]):
    """A `Difference`; None where nothing of the kind has a σ (all held).

    Parameters
    ----------
    delta, sigma : (k, a). names : (k,) str. axes : names of the a columns.
    """
    rows, columns = np.nonzero(np.isfinite(sigma) & (sigma > 0.0))
    if not len(rows):
        return None
    normalised = np.abs(delta[rows, columns]) / sigma[rows, columns]
    normalised = np.where(np.isfinite(normalised), normalised, np.inf)
    worst = int(np.argmax(normalised))
    return Difference(kind, f"{axes[columns[worst]]} {names[rows[worst]]}".strip(), normalised)


@dataclass(frozen=True)
class CovarianceDifference:
    """How the covariance matrices (6 × 6) of the orientation differ.

    Parameters
    ----------
    photographs : number compared.
    sigma : largest |σ_peer/σ_ours − 1|. correlation : largest difference of a correlation. worst : the photograph.
    """

    photographs: int
    sigma: float
    correlation: float
    worst: str

    @property
    def agrees(self) -> bool:
        return self.sigma <= COVARIANCE_LIMIT and self.correlation <= COVARIANCE_LIMIT


def covariance_difference(ours: np.ndarray, peer: np.ndarray, names: np.ndarray) -> CovarianceDifference:
    """Compare (n, 6, 6) covariances; elements that are held in both count as equal."""
    sigma_ours, sigma_peer = (np.sqrt(np.diagonal(q, axis1=1, axis2=2)) for q in (ours, peer))
    free = sigma_ours > 0.0
    ratio = np.where(free, np.abs(sigma_peer / np.where(free, sigma_ours, 1.0) - 1.0), 0.0)
    both = free[:, :, None] & free[:, None, :]
    rho = [q / np.where(both, s[:, :, None] * s[:, None, :], 1.0) for q, s in ((ours, sigma_ours), (peer, sigma_peer))]
    correlation = np.where(both, np.abs(rho[1] - rho[0]), 0.0).max(axis=(1, 2))
    ratio, correlation = (np.nan_to_num(a, nan=np.inf) for a in (ratio.max(axis=1), correlation))
    worst = int(np.argmax(ratio))
    return CovarianceDifference(len(ours), float(ratio.max()), float(correlation.max()), str(names[worst]))


@dataclass(frozen=True)
class PatternDifference:
    """How our formulas and those of the independent model differ, compared directly.

    Parameters
    ----------
    names : of the parameters compared, besides the collinearity equations. max : largest difference of a pattern over
        its largest value. worst : the parameter.
    """

    names: tuple[str, ...]
    max: float
    worst: str

    @property
    def agrees(self) -> bool:
        return self.max <= PATTERN_LIMIT


@dataclass(frozen=True, eq=False)
class PeerCheck:
    """The comparison with one peer.

    Parameters
    ----------
    peer : its name; question : what it answers.
    status : 'agrees', 'differs', 'not converged' or 'not available'; reason : in words, '' when it agrees.
    solver, iterations, seconds : how the peer solved it.
    observations, unknowns : as the peer counts them. vtpv, vtpv_peer : vᵀPv.
    covariance : of the orientation, None where it is not compared.
    patterns : our formulas against the peer's, None where they are not compared.
    checks_parameters : whether the peer has the parameters of the block among its own unknowns.
    notes : what the user has to know about the comparison.
    """

    peer: str
    question: str
    status: str
    reason: str = ""
    solver: str = ""
    iterations: int = 0
    seconds: float = 0.0
    observations: int = 0
    unknowns: int = 0
    vtpv: float = np.nan
    vtpv_peer: float = np.nan
    differences: tuple[Difference, ...] = ()
    covariance: CovarianceDifference | None = None
    patterns: PatternDifference | None = None
    checks_parameters: bool = False
    notes: tuple[str, ...] = field(default=())

    @property
    def vtpv_difference(self) -> float:
        """Relative difference of vᵀPv, peer − ours."""
        return (self.vtpv_peer - self.vtpv) / self.vtpv if self.vtpv else np.nan

    @property
    def compared(self) -> bool:
        return self.status in ("agrees", "differs")

    @property
    def max(self) -> float:
        """Largest |Δ|/σ."""
        return max((d.max for d in self.differences), default=np.nan)


@dataclass(frozen=True, eq=False)
class CrosscheckResult:
    """All comparisons of a block.

    Parameters
    ----------
    parameters : what the block has for parameters, in words such as 'bluh' or 'focal_length_mm'.
    unknown : those of them that the independent model has no formula for.
    """

    block: str
    checks: tuple[PeerCheck, ...]
    parameters: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()

    @property
    def unchecked(self) -> tuple[str, ...]:
        """Parameters that no peer has checked: an adjustment freed of them by us says nothing about them."""
        if any(check.status == "agrees" and check.checks_parameters for check in self.checks):
            return ()
        return self.unknown or self.parameters

    @property
    def verdict(self) -> str:
        """'agrees', 'differs', 'parameters not checked' or 'not checked'.

        A peer that did not converge is a difference.
        """
        if any(check.status in ("differs", "not converged") for check in self.checks):
            return "differs"
        if not any(check.status == "agrees" for check in self.checks):
            return "not checked"
        return "parameters not checked" if self.unchecked else "agrees"

    @property
    def sentence(self) -> str:
        """The verdict in a line."""
        verdict = self.verdict
        if verdict == "parameters not checked":
            verdict = f"parameters not checked ({', '.join(self.unchecked)})"
        return f"{verdict} — {'; '.join(self._part(check) for check in self.checks)}"

    def _part(self, check: PeerCheck) -> str:
        if check.status != "agrees":
            return f"{check.peer} {check.status}: {check.reason}"
        freed = " (image points freed of our own errors)" if self.parameters and not check.checks_parameters else ""
        return f"{check.peer}: max |Δ|/σ {check.max:.2g}, vᵀPv {check.vtpv_difference:+.0e}{freed}"


def judge(check: PeerCheck, more: Sequence[str] = ()) -> PeerCheck:
    """The check with its status and reason, from the numbers in it.

    Parameters
    ----------
    more : reasons besides, why the two differ.
    """
    reasons = [*more]
    reasons += [f"{d.kind} by up to {d.max:.3g} σ ({d.worst})" for d in check.differences if not d.max <= LIMIT]
    if not abs(check.vtpv_difference) <= VTPV_LIMIT:
        reasons.append(f"vᵀPv by {check.vtpv_difference:+.1e} of itself")
    if check.covariance is not None and not check.covariance.agrees:
        reasons.append(
            f"σ of the orientation by up to {100.0 * check.covariance.sigma:.2g} % and its correlations by "
            f"{check.covariance.correlation:.2g} ({check.covariance.worst})"
        )
    if check.patterns is not None and not check.patterns.agrees:
        reasons.append(f"the pattern of {check.patterns.worst} by up to {check.patterns.max:.1e} of itself")
    return replace(check, status="differs" if reasons else "agrees", reason=", ".join(reasons))
