"""Which set of additional parameters to take, by cross-validation over the control points.

[C] The measure is the geometric mean of the RMS in X, Y and Z at control points predicted without themselves: it needs
no weights between plan and height. Sets whose measure differs from the best by less than the standard error of the
difference (bootstrap over the points, the same points for both) cannot be told apart by the control; among them the
image residuals decide, by BIC.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError, counted
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import Block
from aerotri.results.parameter_comparison import Choice, ParameterComparison, SetOutcome

RESAMPLES = 400
"""Bootstrap samples of the control points: the standard error from them is itself good to 1/√800, 3.5 % [D]; more
would not change a choice."""
FEWEST_POINTS = 4
"""Control points below which cross-validation says nothing."""

COMMON = ("bluh:1-12", "brown", "ebner", "gruen", "fourier:2x2", "legendre:5x5", "collocation")
OF_MODEL = {
    "ultracam_d": ("ultracam_d:42-73", "bluh:1-12,ultracam_d:42-73", "ultracam_d:42-73,collocation"),
    "dmc": ("dmc", "bluh:1-12,dmc:30-41+74-77", "dmc:30-41+74-77,collocation"),
}


@dataclass(frozen=True)
class Gain:
    """How much smaller the measure of a set is than that of another: 1 − ratio, and its standard error."""

    against: str
    value: float
    error: float


@dataclass(frozen=True)
class Chosen:
    """The set to take, and why."""

    name: str
    choice: Choice
    reason: str


def candidate_sets(block: Block) -> tuple[Choice, ...]:
    """The sets worth comparing for the cameras of a block, none among them."""
    models = {block.cameras[k].model for k in set(block.images.camera.tolist())}
    specs = ["none", COMMON[0]]
    for model, own in OF_MODEL.items():
        if model in models:
            specs += own
    return tuple(parse_parameters(spec) for spec in (*specs, *COMMON[1:]))


def choose(comparison: ParameterComparison) -> Chosen:
    """The set that the control points and, where they cannot tell, the residuals speak for.

    Raises
    ------
    InputError
        When no set could be adjusted.
    """
    there = [o for o in comparison.outcomes if o.converged]
    if not there:
        raise InputError("the block cannot be adjusted with any set of additional parameters", "try --parameters none")
    usable = [o for o in there if min(o.control.count) >= FEWEST_POINTS]
    if not usable:
        best = min(there, key=lambda o: o.bic)
        why = f"fewer than {FEWEST_POINTS} control points can be predicted from the others: chosen by BIC alone"
        return Chosen(best.name, best.choice, f"additional parameters chosen: {best.name}; {why}")
    best = min(usable, key=lambda o: measure(o.control.difference))
    gains = {o.name: gain(o, best, (o.control.difference, best.control.difference)) for o in usable if o is not best}
    alike = [o for o in usable if o is best or gains[o.name].value >= -gains[o.name].error]
    found = min(alike, key=lambda o: o.bic)
    return Chosen(found.name, found.choice, _reason(found, best, alike, usable))


def _reason(found: SetOutcome, best: SetOutcome, alike: Sequence[SetOutcome], all_sets: Sequence[SetOutcome]) -> str:
    rms = ", ".join(f"{axis} {value:.3f}" for axis, value in zip("XYZ", found.control.rms, strict=True))
    text = (
        f"additional parameters chosen: {found.name}; control points, each left out in turn, are predicted to {rms} m "
        f"(RMS); {counted(len(all_sets), 'set')} compared"
    )
    if len(alike) == 1:
        return text + "; every other set predicts them worse, by more than its standard error"
    others = ", ".join(o.name for o in alike if o is not found)
    if found is not best:
        text += f"; {best.name} predicts them best"
    return text + f"; the difference to {others} is within the uncertainty, and of these it has the best BIC"


def measure(difference: np.ndarray) -> float:
    """Geometric mean, m, of the RMS in X, Y and Z of differences (k, 3)."""
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(np.sqrt(np.nanmean(difference**2, axis=0))))))


def gain(outcome: SetOutcome, other: SetOutcome, differences: tuple[np.ndarray, np.ndarray]) -> Gain:
    """How much smaller the measure of a set is than another's, at the same points (k, 3) m of both."""
    own, against = differences
    known = np.isfinite(own).all(axis=1) & np.isfinite(against).all(axis=1)
    own, against = own[known] ** 2, against[known] ** 2
    if not len(own):
        return Gain(other.name, float("nan"), float("nan"))
    # drawing goes by place: the same points in another order have to give the same
    order = np.lexsort(np.hstack([own, against]).T)
    own, against = own[order], against[order]
    chosen = np.random.default_rng(0).multinomial(len(own), np.full(len(own), 1.0 / len(own)), RESAMPLES)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.exp(0.5 * np.mean(np.log(chosen @ own) - np.log(chosen @ against), axis=1))
        value = 1.0 - float(np.exp(0.5 * np.mean(np.log(own.sum(axis=0)) - np.log(against.sum(axis=0)))))
    return Gain(other.name, value, float(np.nanstd(ratio)))


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
