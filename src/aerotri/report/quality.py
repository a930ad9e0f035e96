"""Is it good? The numbers a result is judged by, each beside what it should be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincinv, ndtri

from aerotri.statistics.adjusted_block import RAY_STATUS, AdjustedBlock, GroundPointResults

ENOUGH_CHECK_POINTS = 30
WEAK_REDUNDANCY = 0.1
SIGNIFICANT_T = 1.96


@dataclass(frozen=True)
class Finding:
    """One number of a result and what it is compared with.

    Parameters
    ----------
    level : 'good', 'note' or 'attention'.
    """

    quantity: str
    value: str
    expected: str
    verdict: str
    level: str


@dataclass(frozen=True, eq=False)
class GroundStatistics:
    """Differences adjusted − given over control or check points, metres; NaN where there is no coordinate.

    Parameters
    ----------
    count, rms, mean, max : (3,) of X, Y, Z; max without sign.
    expected : (3,) the RMS that the σ of the adjusted and the given coordinates lead to expect.
    """

    count: np.ndarray
    rms: np.ndarray
    mean: np.ndarray
    max: np.ndarray
    expected: np.ndarray

    @property
    def rmse_h(self) -> float:
        """m, √(RMS_X² + RMS_Y²)."""
        return float(np.hypot(self.rms[0], self.rms[1]))

    @property
    def rmse_v(self) -> float:
        """m."""
        return float(self.rms[2])


def printable(name: object, longest: int = 200) -> str:
    """A name without control characters, so that it can neither move a terminal's cursor nor break a line."""
    text = "".join(c if c.isprintable() else " " for c in str(name))
    return text if len(text) <= longest else text[: longest - 1] + "…"


def metre_digits(sigma: np.ndarray) -> int:
    """Decimals with which the first doubtful digit of a coordinate is still shown: 3, more for close range."""
    finite = sigma[np.isfinite(sigma) & (sigma > 0.0)]
    return int(np.clip(np.ceil(-np.log10(np.median(finite))) + 1, 3, 6)) if len(finite) else 3


def with_sigma(value: float, sigma: float) -> str:
    """'8 308 ± 20': both to two digits of σ, no digits before the point rounded."""
    digits = 0 if sigma <= 0.0 or not np.isfinite(sigma) else max(0, 1 - int(np.floor(np.log10(sigma))))
    return f"{value:,.{digits}f} ± {sigma:,.{digits}f}".replace(",", "\u2009").replace("-", "−")


def two_digits(value: float) -> str:
    """1 234 → '1 200', 0.0123 → '0.012'."""
    rounded = float(f"{value:.2g}")
    return (f"{rounded:,.0f}" if abs(rounded) >= 10.0 else f"{rounded:g}").replace(",", "\u2009").replace("-", "−")


def ground_statistics(adjusted: AdjustedBlock, results: GroundPointResults) -> GroundStatistics:
    """Count, RMS, mean and largest difference by coordinate.

    The given coordinates enter the expected RMS with their own σ. Control points were adjusted: their differences are
    residuals, whose expected size is σ·√r.
    """
    d = results.difference
    given = np.isfinite(d)
    n = given.sum(axis=0)
    filled = np.where(given, d, 0.0)
    sigma = _sigma_given(adjusted, results)
    variance = (
        results.sigma**2 + sigma**2 if results is adjusted.check else (adjusted.outcome.sigma0 * sigma) ** 2 * results.r
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        rms = np.sqrt((filled**2).sum(axis=0) / n)
        mean = filled.sum(axis=0) / n
        largest = np.where(n > 0, np.abs(filled).max(axis=0, initial=0.0), np.nan)
        expected = np.sqrt(np.where(given, variance, 0.0).sum(axis=0) / n)
    return GroundStatistics(n, rms, mean, largest, expected)


def _sigma_given(adjusted: AdjustedBlock, results: GroundPointResults) -> np.ndarray:
    """(k, 3) m, σ of the given coordinates; 0 where none was given."""
    control = adjusted.block.control
    row_of = {int(point): row for row, point in enumerate(control.point)}
    sigma = np.zeros((len(results), 3))
    for i, point in enumerate(results.point):
        row = row_of.get(int(point))
        if row is not None:
            sigma[i] = np.nan_to_num(control.sigma[row])
    return sigma


def asprs_warning(adjusted: AdjustedBlock) -> str:
    """A sentence where there are too few check points for the ASPRS standard, '' otherwise."""
    n = len(adjusted.check)
    if n >= ENOUGH_CHECK_POINTS:
        return ""
    found = (
        "There are no check points" if n == 0 else f"There {'is' if n == 1 else 'are'} {n} check point{'s' * (n > 1)}"
    )
    return (
        f"{found}; the ASPRS Positional Accuracy Standards, edition 2, require at least {ENOUGH_CHECK_POINTS} to test "
        "the accuracy of a product."
    )


def findings(adjusted: AdjustedBlock) -> list[Finding]:
    """What to look at first, in this order: fit, control of errors, check points, gross errors, parameters."""
    found = [_sigma0(adjusted), _redundancy(adjusted)]
    found += _check_points(adjusted)
    found += [_large_residuals(adjusted)]
    found += _parameters(adjusted)
    return found


def pixel_text(value_um: float, adjusted: AdjustedBlock) -> str:
    """', 0.29 px' where all cameras have one size of pixel, '' otherwise."""
    sizes = {camera.pixel_um for camera in adjusted.block.cameras}
    return f", {value_um / sizes.pop():.2f} px" if len(sizes) == 1 else ""


def _sigma0(adjusted: AdjustedBlock) -> Finding:
    o = adjusted.outcome
    value = f"{o.sigma0:.3f} ({o.sigma0_um:.2f} µm{pixel_text(o.sigma0_um, adjusted)})"
    if o.redundancy < 1 or not np.isfinite(o.sigma0):
        return Finding("σ₀", value, "–", "without redundancy nothing can be said", "attention")
    low, high = (float(np.sqrt(2.0 * gammaincinv(o.redundancy / 2.0, p) / o.redundancy)) for p in (0.025, 0.975))
    expected = f"{low:.3f} to {high:.3f} (χ², 95 %) if the a-priori σ are right"
    if o.sigma0 > high:
        verdict = "observations fit worse than their a-priori σ: σ too small, or errors not modelled"
        return Finding("σ₀", value, expected, verdict, "note" if o.sigma0 < 1.5 else "attention")
    if o.sigma0 < low:
        return Finding("σ₀", value, expected, "observations fit better than their a-priori σ: σ too large", "note")
    return Finding("σ₀", value, expected, "agrees with the a-priori σ", "good")


def _redundancy(adjusted: AdjustedBlock) -> Finding:
    o = adjusted.outcome
    share = o.redundancy / o.observations if o.observations else float("nan")
    r = adjusted.rays.r[np.isfinite(adjusted.rays.r)]
    weak = int(np.sum(r < WEAK_REDUNDANCY))
    value = f"{o.redundancy} of {o.observations} observations (mean r {share:.2f})"
    expected = "mean r above 0.5: observations control each other"
    verdict = f"{weak} of {r.size} image coordinates are nearly uncontrolled (r < {WEAK_REDUNDANCY})"
    return Finding("redundancy", value, expected, verdict, "good" if share > 0.5 else "attention")


def _check_points(adjusted: AdjustedBlock) -> list[Finding]:
    results = adjusted.check
    if not len(results):
        return [
            Finding("check points", "none", f"at least {ENOUGH_CHECK_POINTS}", asprs_warning(adjusted), "attention")
        ]
    s = ground_statistics(adjusted, results)
    expected_h, expected_v = float(np.hypot(s.expected[0], s.expected[1])), float(s.expected[2])
    few, digits = len(results) < ENOUGH_CHECK_POINTS, metre_digits(results.sigma)
    found = [
        Finding("check points", f"{len(results)}", f"at least {ENOUGH_CHECK_POINTS} (ASPRS, edition 2)",
                "too few to report a tested accuracy" if few else "enough", "attention" if few else "good"),
    ]  # fmt: skip
    for name, rmse, expected, n in (
        ("RMSE_H at check points", s.rmse_h, expected_h, int(s.count[:2].sum())),
        ("RMSE_V at check points", s.rmse_v, expected_v, int(s.count[2])),
    ):
        found.append(_rmse(name, rmse, expected, n, digits))
    return found + _bias(s, digits)


def _rmse(name: str, rmse: float, expected: float, n: int, digits: int) -> Finding:
    """RMS against the σ of adjusted and given coordinates; n differences make the χ² bound."""
    if n == 0 or not np.isfinite(rmse):
        return Finding(name, "–", "–", "no coordinate to compare", "note")
    limit = expected * float(np.sqrt(2.0 * gammaincinv(n / 2.0, 0.975) / n))
    value = f"{rmse:.{digits}f} m"
    text = f"{expected:.{digits}f} m from the σ; at most {limit:.{digits}f} m (χ², 97.5 %)"
    if rmse > limit:
        return Finding(name, value, text, "larger than the σ say: systematic errors, or σ too small", "attention")
    return Finding(name, value, text, "as the σ say", "good")


def _bias(s: GroundStatistics, digits: int) -> list[Finding]:
    """Coordinates whose mean difference is not what chance leaves."""
    found = []
    for axis, n, mean, rms in zip("XYZ", s.count, s.mean, s.rms, strict=True):
        if n < 5 or not rms > abs(mean):
            continue
        t = abs(mean) / np.sqrt((rms**2 - mean**2) / (n - 1))
        if t > 3.0:
            expected = f"0 within 3 σ of the mean; t = {t:.1f}"
            verdict = "the block is shifted against the check points"
            found.append(
                Finding(f"mean of d{axis} at check points", f"{mean:+.{digits}f} m", expected, verdict, "attention")
            )
    return found


def _large_residuals(adjusted: AdjustedBlock) -> Finding:
    settings = adjusted.block.settings.adjustment
    critical = float(-ndtri(settings.alpha / 2.0))
    w = np.abs(adjusted.rays.w[adjusted.rays.status == RAY_STATUS.index("used")])
    w = w[np.isfinite(w)]
    beyond = int(np.sum(w > critical))
    chance = settings.alpha * w.size
    largest = f", largest {w.max():.1f}" if w.size else ""
    level = "good" if beyond <= chance + 3.0 * np.sqrt(chance) + 1.0 else "attention"
    verdict = (
        "as many as chance leaves" if level == "good" else "more than chance leaves: look at the largest residuals"
    )
    return Finding(f"image coordinates with |w| > {critical:.2f}", f"{beyond} of {w.size}{largest}",
                   f"about {chance:.0f} by chance (α = {100 * settings.alpha:g} %)", verdict, level)  # fmt: skip


def _parameters(adjusted: AdjustedBlock) -> list[Finding]:
    p = adjusted.parameters
    rows = (p.kinds == "additional") & np.isin(p.status, ("estimated", "weighted"))
    if not rows.any():
        verdict = "systematic image errors stay in the block"
        return [Finding("additional parameters", "none", "self-calibration", verdict, "note")]
    significant = int(np.sum(p.t[rows] > SIGNIFICANT_T))
    limit = adjusted.block.settings.adjustment.correlation_limit
    r = np.abs(np.nan_to_num(p.max_correlation[rows & ~p.is_node]))
    if not len(r):
        return [Finding("additional parameters", f"{rows.sum()} nodes of a field", "–",
                        "whether they help, only check points tell", "good")]  # fmt: skip
    strong = int(np.sum(r > limit))
    return [
        Finding("additional parameters", f"{rows.sum()} estimated, {significant} significant",
                f"significant: t > {SIGNIFICANT_T} (95 %)", "whether they help, only check points tell", "good"),
        Finding("largest correlation of a parameter", f"{r.max():.2f}", f"at most {limit:g}",
                f"{strong} parameters are beyond" if strong else "the parameters can be told apart",
                "note" if strong else "good"),
    ]  # fmt: skip
