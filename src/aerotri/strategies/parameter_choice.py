"""Which set of additional parameters to take: the one that predicts best what it was not fitted to.

[C] Image points of every area and of every strip, and every control point, are predicted by all other observations, and
the density with which that is done counts, σ of the prediction included: a set with small errors and smaller σ
loses. −2 ln of it is summed: the mean of areas and strips, which are the same image points, and the control. The
standard error of a difference between two sets follows from how much the areas, the strips and the control points
differ in it. Sets within twice the standard error of the best (Student's t of few areas) cannot be told apart; among
them the one with the largest σ of heights is taken. Blocks too small to be divided are judged by BIC.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit, stdtrit

from aerotri.conventions import InputError, counted
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import Block
from aerotri.results.parameter_comparison import Choice, ParameterComparison, SetOutcome
from aerotri.strategies.object_change import FarMoved, far_moved, frees_the_lens, movement

RESAMPLES = 400
"""Bootstrap samples of the control points: the standard error from them is itself good to 1/√800, 3.5 % [D]; more
would not change a choice."""
ALIKE = 0.975
"""Probability of Student's t whose quantile, in standard errors, is the bound within which two sets are alike [C]: two
standard errors, more where the standard error itself follows from few areas."""
NEGLIGIBLE = 4.0
"""Difference of −2 ln of the density within which two sets are alike whatever its standard error [C]: a likelihood
ratio of 7."""

LENS = "lens:k1+k2+k3+p1+p2"
FIELD = "collocation:13x9"
COMMON = ("brown", LENS, "bluh:1-12", "legendre:5x5", f"{LENS},{FIELD}")
OF_MODEL = {
    "ultracam_d": ("ultracam_d:42-73", "bluh:1-12,ultracam_d:42-73", f"bluh:1-12,ultracam_d:42-73,{FIELD}"),
    "dmc": ("dmc", "bluh:1-12,dmc:30-41+74-77", f"bluh:1-12,dmc:30-41+74-77,{FIELD}"),
}
"""Sets for cameras of one model. A random field is tried beside parameters of the lens, never in their place [C]: its
prior holds what the image points hardly determine near zero, and a lens held near zero bends the block."""


OF_SMALL_BLOCKS = ("brown:K1+K2+K3+P1+P2", LENS, "bluh:1-12", "none")
FEW_PHOTOGRAPHS = 18
"""Photographs below which only sets of a dozen parameters are tried [C]."""


@dataclass(frozen=True)
class Gain:
    """How much smaller the measure of a set is than that of another: 1 − ratio, and its standard error."""

    against: str
    value: float
    error: float


@dataclass(frozen=True)
class Behind:
    """How much worse than the best a set predicts: the difference of −2 ln of the density, and its standard error.

    Parameters
    ----------
    areas : how many areas the standard error follows from.
    """

    best: str
    value: float
    error: float
    areas: int

    @property
    def alike(self) -> bool:
        """Whether the two cannot be told apart."""
        bound = float(stdtrit(max(self.areas - 1, 1), ALIKE))
        return self.value <= max(bound * self.error, NEGLIGIBLE)


@dataclass(frozen=True)
class Rival:
    """A set that cannot be told from the one taken, and the probability that it is the better one."""

    choice: Choice
    groups: str
    kind: str
    weight: float


@dataclass(frozen=True)
class Chosen:
    """The set to take, and why.

    Parameters
    ----------
    groups, kind : of values that change, as of `SetOutcome`.
    rival : of the sets that cannot be told from it the one that makes the object most uncertain; None without one.
    """

    name: str
    choice: Choice
    reason: str
    groups: str = ""
    kind: str = "free"
    rival: Rival | None = None


def sets_to_choose_from(block: Block) -> tuple[Choice, ...]:
    """The sets of `candidate_sets`, of small blocks those with few parameters."""
    if len(block.images) >= FEW_PHOTOGRAPHS:
        return candidate_sets(block)
    return _parsed(OF_SMALL_BLOCKS, block)


def candidate_sets(block: Block) -> tuple[Choice, ...]:
    """The sets worth comparing for the cameras of a block; none among them unless the lens has start values only."""
    models = {block.cameras[k].model for k in set(block.images.camera.tolist())}
    specs: list[str] = list(COMMON)
    for model, own in OF_MODEL.items():
        if model in models:
            specs += own
    # without parameters a strong lens does not converge: from where the others ended it costs least to see that
    return _parsed((*specs, "none"), block)


def _parsed(specs: Sequence[str], block: Block) -> tuple[Choice, ...]:
    """The sets, without "none" where a lens has start values: it would hold what these image points alone gave."""
    cameras = [block.cameras[k] for k in set(block.images.camera.tolist())]
    values = [prior for camera in cameras for part in (camera.lens, camera.brown) for prior in part.values()]
    start_only = any(prior.kind == "free" and prior.value for prior in values)
    return tuple(parse_parameters(spec) for spec in specs if not (start_only and spec == "none"))


def choose(comparison: ParameterComparison) -> Chosen:
    """The set that predicts best, or the most cautious one of those that cannot be told from it.

    Raises
    ------
    InputError
        When no set could be adjusted.
    """
    there = [o for o in comparison.outcomes if o.converged]
    if not there:
        raise InputError("the block cannot be adjusted with any set of additional parameters", "try --parameters none")
    far = far_moved(there)
    there = [o for o in there if o.name not in far]
    borne = replace(comparison, outcomes=tuple(there))
    behind = distances(borne)
    if not behind:
        found = min(there, key=lambda o: (np.nan_to_num(o.bic, nan=np.inf), o.effective))
        alike = [o for o in there if o.bic - found.bic <= NEGLIGIBLE]
        rival = _rival(found, alike, lambda other: (found.bic - other.bic, 0.0))
        why = "the block is too small to predict one part by another: chosen by BIC alone"
        if not np.isfinite(found.bic):
            why = "the block has no redundancy that would tell one set from another: the one with fewest parameters"
        reason = f"additional parameters chosen: {found.name}; {why}"
    else:
        judged = [o for o in there if o.name in behind]
        # two sets of which one predicts nothing that the other does cannot be told apart
        alike = [o for o in judged if behind[o.name].alike] or judged
        # without control no σ says which is the more cautious: the lens free, and little that could bend
        found = max(alike, key=lambda o: (np.nan_to_num(o.evidence.sigma_height), frees_the_lens(o), -o.effective))
        rival = _rival(found, alike, lambda other: _between(found, other))
        reason = _reason(found, alike, behind)
    reason += f"; {counted(len(comparison.outcomes), 'set')} compared{_left_out(found, comparison, far)}"
    return Chosen(found.name, found.choice, reason, found.groups, found.kind, rival)


def _rival(
    found: SetOutcome, alike: Sequence[SetOutcome], between: Callable[[SetOutcome], tuple[float, float]]
) -> Rival | None:
    """Of the sets alike the one whose object would count most.

    Parameters
    ----------
    between : difference of −2 ln of the densities of the set found and another, and its standard error.
    """
    others = [(o, probability_of_better(*between(o))) for o in alike if o is not found]
    counts = [(weight * movement(found, o) ** 2, k) for k, (o, weight) in enumerate(others)]
    known = [one for one in counts if np.isfinite(one[0])]
    if not known:
        return None
    outcome, weight = others[max(known)[1]]
    return Rival(outcome.choice, outcome.groups, outcome.kind, weight)


def probability_of_better(value: float, error: float) -> float:
    """That another set is the better one, both as likely beforehand.

    [L] A difference Δ of −2 ln of the densities makes it 1/(1 + exp(−Δ/2)); of a Δ that is known with a standard error
    s the mean of this is close to that with Δ/√(1 + π·s²/32) (MacKay 1992).

    Parameters
    ----------
    value, error : −2 ln of the density of the set taken less that of the other, and its standard error.
    """
    return float(expit(0.5 * value / np.sqrt(1.0 + np.pi * error**2 / 32.0)))


def _left_out(found: SetOutcome, comparison: ParameterComparison, far: dict[str, FarMoved]) -> str:
    """A sentence about sets that fit the image points better and bend the object; nothing where there is none."""
    better = [o.name for o in comparison.outcomes if o.name in far and o.sigma0 < found.sigma0]
    if not better:
        return ""
    worst = max((far[name] for name in better), key=lambda one: one.leverage)
    return (
        f". Not taken though they fit the image points better: {', '.join(better)}. They bend the block up to "
        f"{worst.leverage:.0f} times as far as their image points can measure. Only control points or precise "
        "positions of the photographs could confirm that"
    )


def _reason(found: SetOutcome, alike: Sequence[SetOutcome], behind: dict[str, Behind]) -> str:
    count, points = len(_deviance(found.evidence.areas)), int(np.isfinite(found.evidence.control).sum())
    by = f"the image points of {count} areas of the block"
    if points:
        by += f" and {counted(points, 'control point')}"
    text = f"additional parameters chosen: {found.name}, which predict {by} best, each from everything else"
    if len(alike) > 1:
        others = ", ".join(o.name for o in alike if o is not found)
        text = (
            f"additional parameters chosen: {found.name}. They predict {by}, each from everything else, as well as "
            f"{others}, and {'their σ are the largest' if _known_sigma(found) else 'they are the fewest'} of these"
        )
    name, next_best = min(
        ((name, b) for name, b in behind.items() if not b.alike), key=lambda one: one[1].value, default=("", None)
    )
    if next_best is not None:
        times = next_best.value / max(next_best.error, 1e-9)
        text += f". {name} is the best of the others, worse by {times:.0f} times the standard error of the difference"
    if found.groups:
        text += f". The parameters change by {found.groups} (probability of this by chance {found.p:.0e})"
    return text


def _known_sigma(outcome: SetOutcome) -> bool:
    """Whether control says how sure the heights are that a set predicts."""
    return bool(np.isfinite(outcome.evidence.sigma_height))


def distances(comparison: ParameterComparison) -> dict[str, Behind]:
    """How much worse than the best every set predicts; empty where the block is too small to say."""
    there = [o for o in comparison.outcomes if o.converged and _deviance(o.evidence.areas).size]
    if not there:
        return {}
    totals = [_between(o, there[0])[0] for o in there]
    best = there[int(np.nanargmin(totals))] if np.isfinite(totals).any() else there[0]
    # an area whose photographs have no point in common predicts nothing, and is predicted by nothing
    judged = {o.name: len(_deviance(o.evidence.areas - best.evidence.areas)) for o in there}
    return {o.name: Behind(best.name, *_between(o, best), judged[o.name]) for o in there}


def _between(outcome: SetOutcome, best: SetOutcome) -> tuple[float, float]:
    """Difference of −2 ln of the densities of two sets, and its standard error."""
    own, other = outcome.evidence, best.evidence
    pairs = ((own.areas, other.areas), (own.strips, other.strips), (own.control, other.control))
    sums = [_sum_of(first - second) for first, second in pairs]
    parts = [one for one in sums[:2] if one is not None]
    if not parts:
        return float("nan"), float("nan")
    value, error = np.mean(parts, axis=0)
    if sums[2] is not None:
        value, error = value + sums[2][0], float(np.hypot(error, sums[2][1]))
    return float(value), float(error)


def _sum_of(differences: np.ndarray) -> tuple[float, float] | None:
    """Sum of differences that are known, and its standard error; None of fewer than two."""
    known = _deviance(differences)
    if len(known) < 2:
        return None
    return float(known.sum()), float(np.std(known, ddof=1) * np.sqrt(len(known)))


def _deviance(values: np.ndarray) -> np.ndarray:
    return values[np.isfinite(values)]


def measure(difference: np.ndarray) -> float:
    """Geometric mean, m, of the RMS in X, Y and Z of differences (k, 3), over the coordinates that have any; NaN where
    none has."""
    known = np.isfinite(difference)
    count = known.sum(axis=0)
    if not count.any():
        return float("nan")
    square = np.sum(np.where(known, difference, 0.0) ** 2, axis=0)[count > 0] / count[count > 0]
    return float(np.sqrt(np.prod(square ** (1.0 / len(square)))))


def gain(outcome: SetOutcome, other: SetOutcome, differences: tuple[np.ndarray, np.ndarray]) -> Gain:
    """How much smaller the measure of a set is than another's, at the same points (k, 3) m of both."""
    return Gain(other.name, *reduction(*differences))


def reduction(own: np.ndarray, against: np.ndarray) -> tuple[float, float]:
    """How much smaller the measure of differences (k, 3) m is than that of others there, and its standard error."""
    known = np.isfinite(own).all(axis=1) & np.isfinite(against).all(axis=1)
    own, against = own[known] ** 2, against[known] ** 2
    if not len(own):
        return float("nan"), float("nan")
    # drawing goes by place: the same points in another order have to give the same
    order = np.lexsort(np.hstack([own, against]).T)
    own, against = own[order], against[order]
    chosen = np.random.default_rng(0).multinomial(len(own), np.full(len(own), 1.0 / len(own)), RESAMPLES)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.exp(0.5 * np.mean(np.log(chosen @ own) - np.log(chosen @ against), axis=1))
        value = 1.0 - float(np.exp(0.5 * np.mean(np.log(own.sum(axis=0)) - np.log(against.sum(axis=0)))))
    ratio = ratio[np.isfinite(ratio)]
    return value, float(np.std(ratio)) if len(ratio) else float("nan")


def gains(comparison: ParameterComparison) -> dict[str, Gain]:
    """What every set gains on the best of those it contains, at check points and predicted control together."""
    there = [o for o in comparison.outcomes if o.converged]
    found = {}
    for outcome in there:
        inside = [o for o in there if o is not outcome and _items(o) < _items(outcome)]
        if inside and len(_points(outcome)):
            best = min(inside, key=lambda o: measure(_points(o)))
            found[outcome.name] = gain(outcome, best, (_points(outcome), _points(best)))
    return found


def standings(comparison: ParameterComparison) -> dict[str, Gain]:
    """How far every set is behind the one that does best at check points and predicted control together."""
    there = [o for o in comparison.outcomes if o.converged and len(_points(o))]
    if not there:
        return {}
    best = min(there, key=lambda o: measure(_points(o)))
    return {o.name: gain(o, best, (_points(o), _points(best))) for o in there}


def _items(outcome: SetOutcome) -> set[tuple[str, str]]:
    return {(family, item) for family, items in outcome.choice for item in items}


def _points(outcome: SetOutcome) -> np.ndarray:
    """(k, 3) m, differences at all points that took no part."""
    return np.concatenate([outcome.check.difference, outcome.control.difference])
