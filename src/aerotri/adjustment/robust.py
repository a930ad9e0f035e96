"""Robust weights of rays: which estimator, and what it takes from the residuals.

A ray is weighted as a whole, by the length e of its two residuals, each divided by its a-priori σ. With s the robust
standard deviation of the residuals, re-estimated from their median so that a wrong a-priori σ neither switches an
estimator off nor turns good rays down, the weights are:

huber     1, beyond 2s: 2s/e. Long residuals pull with constant force. [L: Huber, Robust statistics, 1981]
danish    1, beyond 3s: exp(1 − (e/3s)²). [L: Krarup, Kubik and Juhl, Götterdämmerung over least squares adjustment,
          ISPRS Hamburg 1980; this form of it C]
cauchy    1/(1 + (e/2.55s)²), which keeps 95 % of the efficiency of least squares for normal errors in two coordinates
          (the 2.385 of the textbooks is for one). [L: Barnett and Lewis, Outliers in statistical data; the constant D]
adaptive  what the residuals themselves ask for: they are taken for a mixture of good ones and of gross errors K times
          as spread, the share of gross errors and K estimated along; the weight is the probability that the ray is good
          plus 1/K² of the contrary. Without gross errors it is least squares. [L: the contaminated normal distribution
          of Tukey, A survey of sampling from contaminated distributions, 1960, with EM weights after Aitkin and Wilson,
          Technometrics 22, 1980; its use here C]

All but Huber's turn a ray down the more the longer its residual is, have local minima, and therefore start from Huber's
solution. Every cost ρ fits its weight w = ρ'/(2e), so that a step can be tested by its cost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment import _robust_kernels as _kernels

STAGES = {
    "off": ("off",),
    "huber": ("huber",),
    "danish": ("huber", "danish"),
    "cauchy": ("huber", "cauchy"),
    "adaptive": ("huber", "adaptive"),
    "data-snooping": ("off",),
}
"""The estimators to go through, one after the other, by the setting `robust`; data snooping begins unweighted."""

CODES = {"off": _kernels.NONE, "huber": _kernels.HUBER, "danish": _kernels.DANISH, "cauchy": _kernels.CAUCHY}
LIMITS = {"huber": 2.0, "danish": 3.0, "cauchy": 2.55, "adaptive": 1.0}
"""Normalised residual length where an estimator turns, in robust standard deviations; 87 % and 99 % of good rays lie
below 2 and 3 (two coordinates, Rayleigh)."""

SAME_LIMIT = 0.01
"""Relative change of a limit that is none."""

RAYLEIGH_MEDIAN = float(np.sqrt(2.0 * np.log(2.0)))
"""Median length of a vector of two coordinates with σ = 1: √(2 ln 2), of the Rayleigh distribution [L]."""
EM_ROUNDS, EM_SAMPLE = 60, 2000
"""Iterations, and quantiles that stand for all residuals [C]: the outcome is rounded to steps of the code, so that
more of either change nothing; fewer may stop before the share of gross errors stands."""
FEWEST_GROSS, MOST_GROSS, WIDEST = 1e-6, 0.5, 5
"""Bounds of the share of gross errors, and of their spread as a power of ADAPTIVE_SPREAD [C]: a share of 0 could never
grow again, above one half gross errors would be the good ones; 3⁵ = 243 times the spread is far off."""


@dataclass(frozen=True)
class Estimator:
    """What the kernels need: code of the weight function and its limit in units of the a-priori σ."""

    code: int = _kernels.NONE
    limit: float = 0.0

    @property
    def is_robust(self) -> bool:
        return self.code != _kernels.NONE

    @property
    def scale(self) -> float:
        """The robust standard deviation of the residuals that it was made for, in a-priori σ; 1 when not robust."""
        name = {code: name for name, code in CODES.items()}.get(self.code, "adaptive")
        return self.limit / LIMITS[name] if self.is_robust else 1.0

    def is_near(self, other: Estimator) -> bool:
        """Whether the two weigh practically alike."""
        if not (self.is_robust and other.is_robust):
            return self == other
        apart = abs(self.code - other.code)
        same = apart == 0 or (apart == 1 and min(self.code, other.code) >= _kernels.ADAPTIVE)
        return same and abs(self.limit / other.limit - 1.0) <= SAME_LIMIT


LEAST_SQUARES = Estimator()


def estimator_for(name: str, length: np.ndarray, redundancy_share: float) -> Estimator:
    """The estimator of that name for rays whose normalised residuals have these lengths.

    Parameters
    ----------
    name : 'off' or a key of `LIMITS`. length : (m,).
    redundancy_share : redundancy / observations, by which residuals are smaller than errors.
    """
    if name == "off":
        return LEAST_SQUARES
    scale = max(scale_of(length, redundancy_share), 1e-12)
    code = _adaptive_code(length / scale) if name == "adaptive" else CODES[name]
    return Estimator(code, LIMITS[name] * scale)


def normalised_lengths(residual: np.ndarray, inv_sigma: np.ndarray) -> np.ndarray:
    """(m,) lengths of residuals (m, 2) mm with (m, 2) 1/σ in 1/mm."""
    return np.hypot(residual[:, 0] * inv_sigma[:, 0], residual[:, 1] * inv_sigma[:, 1])


def scale_of(length: np.ndarray, redundancy_share: float) -> float:
    """Robust standard deviation of normalised residuals, from the median of their lengths (m,)."""
    if not len(length):
        return 1.0
    return float(np.median(length)) / RAYLEIGH_MEDIAN / np.sqrt(max(redundancy_share, 0.05))


def weights_and_costs(estimator: Estimator, length: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m,) weights and (m,) costs of rays with normalised residual lengths (m,)."""
    weight, cost = np.empty(len(length)), np.empty(len(length))
    _kernels.robust_factors(np.ascontiguousarray(length, dtype=float), estimator.code, estimator.limit, weight, cost)
    return weight, cost


def _adaptive_code(length: np.ndarray) -> int:
    """Code of the adaptive estimator for residual lengths (m,) in robust standard deviations.

    EM for the share of gross errors and their variance K² with the good ones' held at 1; a sample of the quantiles
    stands for all residuals.
    """
    t = np.quantile(length, (np.arange(EM_SAMPLE) + 0.5) / EM_SAMPLE) ** 2 if len(length) else np.zeros(1)
    share, variance = 0.05, 1e3
    for _ in range(EM_ROUNDS):
        odds = share / ((1.0 - share) * variance)
        with np.errstate(over="ignore"):
            gross = 1.0 - 1.0 / (1.0 + odds * np.exp(0.5 * t * (1.0 - 1.0 / variance)))
        share = float(np.clip(gross.mean(), FEWEST_GROSS, MOST_GROSS))
        if gross.sum() > 0.0:
            variance = max(float(np.sum(gross * t) / (2.0 * gross.sum())), _kernels.ADAPTIVE_SPREAD**2)
    wide = int(np.clip(round(np.log(variance) / (2.0 * np.log(_kernels.ADAPTIVE_SPREAD))), 1, WIDEST))
    odds = share / ((1.0 - share) * _kernels.ADAPTIVE_SPREAD ** (2 * wide))
    step = int(np.clip(round(-_kernels.ADAPTIVE_PER_DECADE * np.log10(odds)), 0, _kernels.ADAPTIVE_STEPS - 1))
    return _kernels.ADAPTIVE + _kernels.ADAPTIVE_STEPS * (wide - 1) + step
