"""Variance components: the σ of whole groups of observations, estimated from the residuals of the adjustment itself.

[L: Helmert 1907; Förstner 1979] Förstner's σ̂²_g = Ω_g/r_g, with Ω_g = vᵀPv and r_g = Σ redundancy numbers of the group,
is right once it is 1 in every group, and comes there slowly where r_g is much smaller than the number of observations.
So each round solves Helmert's S·θ = Ω for the factors θ of the variances, S_gh = Σ R_ij² over i in g, j in h and
R = Q_vv·P: the same fixed point, Ω_g = r_g, in a few rounds. 2·S⁻¹ is the covariance of the factors, so that a group
counts 1/(S⁻¹)_gg degrees of freedom: less than r_g, since its residuals are correlated and partly owed to other groups.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.quantiles import chi_square_quantile
from aerotri.results.adjusted_block import AdjustedBlock, ObservationGroup
from aerotri.results.variance_components import ChiSquareTest, VarianceComponent, VarianceComponents
from aerotri.statistics.observation_groups import EXTRA_GROUPS, GroupFit, group_fits
from aerotri.strategies.residual_response import ResidualResponse, cross_redundancy

MAX_ROUNDS = 10
"""Adjustments with new σ [C]: groups that can be told apart settle in a few; more would only delay the message."""
SETTLED = 0.01
"""Relative change of every σ below which the components stand still."""

LARGEST_STEP = 3.0
"""Factor by which a σ may change in one round."""

CAUTION = 2.0
"""Added to an S_gg below `LEAST_FREEDOM`, but no more than r_g: the σ of a group with little redundancy then changes
no faster than by Förstner's ratio."""

FRESH = 0.2
"""Relative change of a σ up to which S is not computed anew."""

LEAST_FREEDOM = 3.0
"""Degrees of freedom below which a group says too little of its σ [C]: its own σ would be uncertain by over 40 %."""

NO_REDUNDANCY = 1e-3
"""Redundancy of a group below which its residuals are zero whatever its σ."""

MEDIAN_EFFICIENCY = 0.37
"""Efficiency of a σ from the median of |w|, against that from squares [L: Huber 1981]."""

PROBES, LAST_PROBES = 4, 8
"""Random products a group for S, on the way and for the final uncertainty: 8 give it to some 5 %."""

AGREES, TOO_SMALL, TOO_LARGE, NOT_TESTABLE = "agrees", "σ given too small", "σ given too large", "not testable"


@dataclass(frozen=True, eq=False)
class Fitted:
    """An adjustment as the estimation needs it: the result in the frame of the equations, and these."""

    adjusted: AdjustedBlock
    system: NormalSystem
    solution: Solution


def estimate_components(
    first: Fitted, readjust: Callable[[Mapping[str, float]], Fitted]
) -> tuple[VarianceComponents, Fitted]:
    """Estimate the components of an adjustment and adjust anew with them, until nothing moves.

    A group that turns out to have less than `LEAST_FREEDOM` gets its given σ back, and the others are estimated anew.

    Parameters
    ----------
    first : the adjustment with the σ as given.
    readjust : adjusts with the σ as given times the factors of the groups.

    Returns
    -------
    The components, and the adjustment with them.
    """
    fitted, held = first, {}
    factors = {fit.name: 1.0 for fit in group_fits(first.adjusted)}
    rounds, last_round = 0, MAX_ROUNDS
    information = _Information.at(fitted, factors)
    while True:
        if not information.serves(fitted, factors):
            information = _Information.at(fitted, factors)
        changes = _changes(fitted, information, held)
        # a σ that shrinks although its group says nothing of it any more goes to zero: it will be held
        settled = all(abs(c - 1.0) < SETTLED or (c < 1.0 and information.of(name) < 1.0) for name, c in changes.items())
        if settled or rounds >= last_round:
            freedom = _freedom(fitted, held)
            weak = [name for name, f in freedom.items() if name not in held and not f >= LEAST_FREEDOM]
            if not weak:
                return _components(fitted, factors, freedom, held, rounds, settled), fitted
            # the weakest alone: without it the others may be told apart
            name = min(weak, key=lambda weak_name: freedom[weak_name])
            held[name] = f"its residuals say too little of it ({freedom[name]:.1f} degrees of freedom)"
            factors, last_round = {**factors, name: 1.0}, max(last_round, rounds + MAX_ROUNDS // 2)
        else:
            factors = {name: factor * changes.get(name, 1.0) for name, factor in factors.items()}
        fitted, rounds = readjust(factors), rounds + 1


@dataclass(frozen=True, eq=False)
class _Information:
    """S, and the factors it was computed at: it serves the way to the solution while they change little."""

    names: tuple[str, ...]
    s: np.ndarray
    factors: Mapping[str, float]

    @classmethod
    def at(cls, fitted: Fitted, factors: Mapping[str, float], probes: int = PROBES) -> _Information:
        names = tuple(fit.name for fit in group_fits(fitted.adjusted))
        s = cross_redundancy(ResidualResponse(fitted.system, fitted.solution), names, probes)
        return cls(names, s, dict(factors))

    def of(self, name: str) -> float:
        """S_gg."""
        k = self.names.index(name)
        return float(self.s[k, k])

    def serves(self, fitted: Fitted, factors: Mapping[str, float]) -> bool:
        """Whether it is still of use for an adjustment with these factors."""
        # data snooping may have taken out the last observation of a group
        same = self.names == tuple(fit.name for fit in group_fits(fitted.adjusted))
        changes = [factors.get(name, 1.0) / self.factors.get(name, 1.0) for name in self.names]
        return same and all(abs(np.log(change)) < FRESH for change in changes)


def _changes(fitted: Fitted, information: _Information, held: Mapping[str, str]) -> dict[str, float]:
    """The factors by which the σ of the groups not held should change, from one solution of S·θ = Ω."""
    fits = group_fits(fitted.adjusted)
    awake = [k for k, fit in enumerate(fits) if fit.name not in held and fit.redundancy > NO_REDUNDANCY]
    s = information.s[np.ix_(awake, awake)]
    excess = np.array([fits[k].omega - fits[k].redundancy for k in awake])
    redundancy = np.array([fits[k].redundancy for k in awake])
    caution = np.where(np.diagonal(s) < LEAST_FREEDOM, np.minimum(redundancy, CAUTION), 0.0)
    theta = 1.0 + np.linalg.solve(s + np.diag(caution), excess)
    bounded = np.clip(theta, LARGEST_STEP**-2, LARGEST_STEP**2)
    return {fits[k].name: float(np.sqrt(t)) for k, t in zip(awake, bounded, strict=True)}


def _freedom(fitted: Fitted, held: Mapping[str, str]) -> dict[str, float]:
    """Degrees of freedom 1/(S⁻¹)_gg of every group; r_g of those held."""
    fits = group_fits(fitted.adjusted)
    information = _Information.at(fitted, {}, LAST_PROBES)
    names, s = information.names, information.s
    freedom = {}
    free = [k for k, name in enumerate(names) if name not in held and s[k, k] > NO_REDUNDANCY]
    inverse = np.linalg.pinv(s[np.ix_(free, free)], hermitian=True)
    for k, fit in enumerate(fits):
        value = 1.0 / inverse[free.index(k), free.index(k)] if k in free else fit.redundancy
        freedom[fit.name] = float(value) * (MEDIAN_EFFICIENCY if fit.robust else 1.0)
    return freedom


def _components(
    fitted: Fitted,
    factors: Mapping[str, float],
    freedom: Mapping[str, float],
    held: Mapping[str, str],
    rounds: int,
    settled: bool,
) -> VarianceComponents:
    alpha = fitted.adjusted.block.settings.adjustment.alpha
    out = []
    for fit in group_fits(fitted.adjusted):
        name, factor = fit.name, factors.get(fit.name, 1.0)
        f = freedom[name]
        test = _test(name, factor * _ratio(fit), f, alpha)
        out.append(
            VarianceComponent(
                group=name,
                unit=fit.unit,
                count=fit.count,
                redundancy=fit.redundancy,
                sigma_apriori=fit.sigma / factor,
                factor=factor,
                factor_sigma=float("nan") if name in held else factor / float(np.sqrt(2.0 * f)),
                freedom=f,
                held=held.get(name, ""),
                test=test,
            )
        )
    return VarianceComponents(tuple(out), rounds, settled)


def _ratio(fit: GroupFit) -> float:
    """σ a posteriori / σ used, of one group alone: Förstner's √(Ω/r)."""
    return float(np.sqrt(fit.omega / fit.redundancy)) if fit.redundancy > NO_REDUNDANCY else float("nan")


def _test(group: str, ratio: float, freedom: float, alpha: float) -> ChiSquareTest:
    if not (freedom >= 1.0 and np.isfinite(ratio)):
        nan = float("nan")
        return ChiSquareTest(group, ratio, freedom, nan, nan, nan, NOT_TESTABLE)
    statistic = freedom * ratio**2
    low, high = (float(limit) for limit in chi_square_quantile([alpha / 2.0, 1.0 - alpha / 2.0], freedom))
    verdict = TOO_SMALL if statistic > high else TOO_LARGE if statistic < low else AGREES
    return ChiSquareTest(group, ratio, freedom, statistic, low, high, verdict)


def chi_square_tests(adjusted: AdjustedBlock) -> tuple[ChiSquareTest, ...]:
    """Whether the σ given for every group agree with its residuals, two-sided at the level `alpha` of the block.

    With variance components: of the factors found, with their degrees of freedom. Without: Ω_g against χ² of r_g, as if
    the σ of the other groups were right; the residuals of a group being correlated, it finds less than it might, and
    raises no more false alarms than `alpha`.

    Parameters
    ----------
    adjusted : in the frame of the adjustment, or of a block in local coordinates.
    """
    if adjusted.components is not None:
        return tuple(component.test for component in adjusted.components.components)
    alpha = adjusted.block.settings.adjustment.alpha
    return tuple(_test(fit.name, _ratio(fit), fit.redundancy, alpha) for fit in group_fits(adjusted))


def with_components(adjusted: AdjustedBlock, components: VarianceComponents) -> AdjustedBlock:
    """The result of the adjustment with the components' σ: its groups are those of the components.

    Their `sigma_apriori` is as given, `sigma_aposteriori` the σ that the final residuals ask for.
    """
    factors, groups = components.factors, []
    for fit in group_fits(adjusted):
        given, found = fit.sigma / factors[fit.name], fit.sigma * _ratio(fit)
        groups.append(ObservationGroup(fit.name, fit.count, given, fit.rms, fit.redundancy, found))
    replaced = {"control plan", "control height", *(name for name, _ in EXTRA_GROUPS)}
    others = [g for g in adjusted.groups if g.name not in replaced and not g.name.startswith("image points")]
    return replace(adjusted, groups=(*groups, *others), components=components)


def in_words(components: VarianceComponents) -> tuple[str, ...]:
    """Sentences about what was changed, what was not, and what did not settle."""
    said = []
    for c in components.components:
        if c.held:
            said.append(f"the σ of {c.group} is held as given: {c.held}")
        elif abs(c.factor - 1.0) > SETTLED:
            said.append(
                f"the σ of {c.group} was changed from {_value(c.sigma_apriori, c.unit)} to {_value(c.sigma, c.unit)}, "
                f"by a factor of {c.factor:.3g} ± {c.factor_sigma:.2g} (χ² test of the σ given: {c.test.verdict})"
            )
    if not components.settled:
        said.append(f"the variance components did not settle within {components.rounds} rounds")
    return tuple(said)


def _value(sigma: float, unit: str) -> str:
    return f"{np.degrees(sigma):.3g}°" if unit == "rad" else f"{sigma:.3g} {unit}"
