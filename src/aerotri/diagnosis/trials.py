"""A hypothesis put to the proof: the changed block adjusted, and compared with the block as it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aerotri import of_known
from aerotri.conventions import InputError
from aerotri.diagnosis.finding import GRADES
from aerotri.diagnosis.hypothesis import Hypothesis
from aerotri.diagnosis.verdict import judge
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.failure import AdjustmentFailedError

Adjust = Callable[[Block], AdjustedBlock]

CLEARLY_BETTER = 1.5
"""Factor by which the misfit has to shrink before a change explains a block [C]: weaker ones come by chance among so
many changes; mistakes usually give far more."""
MORE_RAYS = 1.1
"""Factor by which the rays in use have to grow for a change to count by them alone [C]: a few percent vary with the
rejection of outliers."""
NEARLY_ALL = 0.9
"""Share of the rays in use that a change has to keep [C]: with fewer a block fits better because what contradicts is
gone."""


@dataclass(frozen=True, eq=False)
class Trial:
    """How a block fits: its verdict ('' where it has no result), misfit and share of rays in use.

    Parameters
    ----------
    misfit : the largest of σ̂0 and the RMS of the check points over their σ.
    focal_length_mm : of the cameras, adjusted.
    """

    level: str
    sigma0: float
    misfit: float
    used: float
    focal_length_mm: tuple[float, ...] = ()

    @property
    def rank(self) -> int:
        """0 accepted … 2 rejected, 3 without result."""
        return GRADES.index(self.level) if self.level else 3


FAILED = Trial("", np.inf, np.inf, 0.0)
"""A block that cannot be adjusted: worse than any result."""


def trial_of(result: AdjustedBlock) -> Trial:
    """How an adjusted block fits."""
    w = result.check.w
    check = of_known.rms(w) if np.isfinite(w).any() else 0.0
    sigma0 = result.outcome.sigma0 if np.isfinite(result.outcome.sigma0) else np.inf
    level = result.outcome.verdict or judge(result).level
    own = result.parameters.names == "focal_length_mm"
    measured = np.bincount(result.block.image_points.point, minlength=len(result.block.points))
    several = measured[result.block.image_points.point] >= 2
    used = float((result.rays.status == 0)[several].mean()) if several.any() else 0.0
    return Trial(level, sigma0, max(sigma0, check), used, tuple(result.parameters.value[own].tolist()))


def try_adjusting(block: Block, adjust: Adjust) -> Trial:
    """The trial of a block, whatever becomes of it."""
    try:
        return trial_of(adjust(block))
    except (AdjustmentFailedError, InputError):
        return FAILED


def explains(before: Trial, after: Trial) -> bool:
    """Whether a change makes a block clearly better; a change that leads to no result explains nothing."""
    if not after.level:
        return False
    if after.rank > before.rank or after.used < NEARLY_ALL * before.used:
        return False
    if after.rank < before.rank and after.misfit <= max(before.misfit, 1.5):
        return True
    if after.used >= MORE_RAYS * before.used and after.misfit <= max(3.0, CLEARLY_BETTER * before.misfit):
        return True
    return before.misfit >= CLEARLY_BETTER * max(after.misfit, 1.0)


def order(trial: Trial) -> tuple[int, float, int]:
    """Best first: verdict, then rays in use and misfit in coarse steps."""
    return (trial.rank, -round(trial.used, 1), round(float(np.log(np.clip(trial.misfit, 1.0, 1e9))) / 0.15))


def in_words(hypothesis: Hypothesis, before: Trial, after: Trial) -> str:
    """'photograph 7: its measurements fit 400 times better with x negated (σ₀ 1.03 in place of 412)'."""
    subject = "the block" if hypothesis.subject == "block" else hypothesis.subject
    fits = "fit" if hypothesis.plural else "fits"
    return f"{subject} {fits} {_better(before, after)} with {hypothesis.remedy} ({_numbers(before, after)})"


def _better(before: Trial, after: Trial) -> str:
    """'400 times better'; by the check points where σ̂0 hardly changes."""
    for was, now in ((before.sigma0, after.sigma0), (before.misfit, after.misfit)):
        ratio = was / max(now, 1e-12)
        if np.isfinite(ratio) and ratio >= CLEARLY_BETTER:
            return f"{ratio:.0f} times better" if ratio >= 10.0 else f"{ratio:.1f} times better"
    return "better"


def _numbers(before: Trial, after: Trial) -> str:
    """What changes: σ̂0, the check points, the rays in use."""
    if not before.level:
        return f"σ₀ {after.sigma0:.3g}; as it is, there is no result"
    said = [f"σ₀ {after.sigma0:.3g} in place of {before.sigma0:.3g}"]
    if before.sigma0 < CLEARLY_BETTER * after.sigma0 and before.misfit > CLEARLY_BETTER * after.misfit:
        said = [f"check points {after.misfit:.2g} times their σ in place of {before.misfit:.2g} times"]
    if after.used >= MORE_RAYS * before.used:
        said.append(f"{100.0 * after.used:.0f} % of the rays in use in place of {100.0 * before.used:.0f} %")
    return ", ".join(said)


def completed(block: Block, centre: np.ndarray, angles: np.ndarray) -> Block:
    """The block with start values where it has none, from a placed model."""
    own = block.images
    missing = ~(np.isfinite(own.centre).all(axis=1) & np.isfinite(own.angles).all(axis=1))
    missing &= np.isfinite(centre[:, 0])
    if not missing.any():
        return block
    return replace(
        block,
        images=replace(
            own, centre=np.where(missing[:, None], centre, own.centre),
            angles=np.where(missing[:, None], angles, own.angles),
        ),
    )  # fmt: skip
