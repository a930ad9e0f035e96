"""What a free check found, and its verdict: tie points or control, in words that an operator can act on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.statistics.similarity import Similarity

FREE, CONTROL, POSITIONS = "tie points alone", "with control", "with observed positions"
INFLATED = 1.1
"""σ̂0 of the free block over the robust spread of its residuals, from which on gross errors decide the fit."""
POOR_SIGMA0 = 1.5
"""σ̂0 of the free block from which on the tie points fit worse than their σ says, gross errors or not."""
DECIMALS = 3
ANGLES = ("omega", "phi", "kappa")


@dataclass(frozen=True)
class Stage:
    """One adjustment of the row, and the test of what it added to the one before.

    Parameters
    ----------
    name : what takes part. status, message : as in `Outcome`.
    sigma0, vtpv, redundancy : of this adjustment, with the weights of the test.
    added : observations and conditions it has more. ratio : Δ(vᵀPv)/Δr/σ̂0²free, NaN where nothing is tested.
    limit : what the ratio exceeds with probability α.
    largest_w, w_limit : largest normalised residual of what was added, and what the largest exceeds with probability α.
    """

    name: str
    status: str
    message: str
    sigma0: float
    vtpv: float
    redundancy: int
    added: int = 0
    ratio: float = np.nan
    limit: float = np.nan
    largest_w: float = np.nan
    w_limit: float = np.nan

    @property
    def tested(self) -> bool:
        return bool(np.isfinite(self.ratio))

    @property
    def fits(self) -> bool:
        """Neither all that was added together nor any single value of it contradicts."""
        return self.tested and self.ratio <= self.limit and not self.largest_w > self.w_limit


@dataclass(frozen=True)
class Suspect:
    """A value that contradicts the rest.

    Parameters
    ----------
    kind : 'ray', 'control' or 'position'. name : the point, or photograph and point. component : 'X', 'x', 'omega' ….
    w : normalised residual. error : −v/r, m (rad for attitudes, mm for rays). error_px : pixels, of rays.
    """

    kind: str
    name: str
    component: str
    w: float
    error: float
    error_px: float = np.nan


@dataclass(frozen=True, eq=False)
class FreeCheck:
    """Tie points or control?

    Parameters
    ----------
    stages : the adjustments, the free one first. sigma0_full : of the adjustment as delivered, NaN if there is none.
    spread : robust spread of w in the free block. beyond : rays whose |w| no chance explains.
    suspects : largest |w| first: rays where the tie points do not fit, control and positions where these do not.
    point : (k,) str, control points of the free block. similarity : onto their given coordinates, None if these do not
        determine it.
    position_offset : (3,) m, mean of observed positions less where control alone puts them; None if not known.
    robust : whether the weights are robust, so that the limits hold only approximately.
    """

    stages: tuple[Stage, ...]
    sigma0_full: float
    spread: float
    beyond: int
    suspects: tuple[Suspect, ...]
    point: np.ndarray
    similarity: Similarity | None
    position_offset: np.ndarray | None
    robust: bool = False

    @property
    def tie_points_poor(self) -> bool:
        return poor_fit(self.stages[0], self.spread)

    @property
    def verdict(self) -> str:
        """'fits', 'control', 'tie points', 'both', 'not tested' or 'failed'."""
        free, added = self.stages[0], self.stages[1:]
        if np.isnan(free.sigma0) and free.status != "converged":
            return "failed"
        contradicts = any(stage.status != "converged" or (stage.tested and not stage.fits) for stage in added)
        if self.tie_points_poor:
            return "both" if contradicts else "tie points"
        if contradicts:
            return "control"
        return "fits" if any(stage.tested for stage in added) else "not tested"

    @property
    def sentence(self) -> str:
        """The verdict with its reasons, in words that an operator can act on."""
        if self.verdict == "failed":
            free = self.stages[0]
            return (
                f"The tie points alone give no block ({free.status}: {free.message}): whether the control fits is not "
                "known."
            )
        parts = [_tie_points(self), *(_added(self, stage) for stage in self.stages[1:])]
        if self.robust:
            parts.append("Weights are robust: the limits hold approximately.")
        return " ".join(parts)


def poor_fit(free: Stage, spread: float) -> bool:
    """Whether gross errors or errors not modelled decide how the tie points fit one another.

    Parameters
    ----------
    spread : robust spread of w in the free block.
    """
    return free.redundancy > 0 and (free.sigma0 > INFLATED * spread or free.sigma0 > POOR_SIGMA0)


def suspect_text(suspect: Suspect) -> str:
    """'C05: given X too large by 1.020 m (w 34.0)'."""
    size, w = abs(suspect.error), f"w {abs(suspect.w):.1f}"
    if suspect.kind == "ray":
        return f"{suspect.name}: {suspect.component} off by {abs(suspect.error_px):.1f} px ({w})"
    too = "large" if suspect.error > 0 else "small"
    unit, value = ("rad", f"{size:.2e}") if suspect.component in ANGLES else ("m", f"{size:.{DECIMALS}f}")
    given = "given" if suspect.kind == "control" else "observed"
    return f"{suspect.name}: {given} {suspect.component} too {too} by {value} {unit} ({w})"


def _tie_points(check: FreeCheck) -> str:
    free = check.stages[0]
    stand_out = f"{check.beyond} ray{'s' if check.beyond != 1 else ''}"
    if free.redundancy <= 0:
        return "The tie points have no redundancy: nothing tests them."
    if not check.tie_points_poor:
        all_the_same = f"; {stand_out} stand{'s' if check.beyond == 1 else ''} out all the same" if check.beyond else ""
        return f"The tie points fit one another (σ0 free {free.sigma0:.2f}{all_the_same})."
    if free.sigma0 > INFLATED * check.spread and check.beyond:
        rays = [suspect for suspect in check.suspects if suspect.kind == "ray"]
        first = f" Look at {suspect_text(rays[0])} first." if rays else ""
        return (
            f"The tie points themselves do not fit (σ0 free {free.sigma0:.2f}, {free.sigma0 / check.spread:.1f} times "
            f"the spread of most residuals, {stand_out} beyond chance).{first}"
        )
    return (
        f"The tie points themselves do not fit (σ0 free {free.sigma0:.2f}) though few rays stand out: the a-priori σ of "
        "the image points is too small, or systematic image errors are not modelled."
    )


def _added(check: FreeCheck, stage: Stage) -> str:
    what, to = _subjects(check, stage)
    verb = "do" if what.endswith("s") else "does"
    if stage.status != "converged":
        return f"With {what} the adjustment has no result ({stage.status}: {stage.message}): {_offset(check)}"
    if not stage.tested:
        return f"Nothing tests {what}: no redundancy is gained."
    numbers = f"vᵀPv grows by {stage.ratio:.2f} σ0² per redundancy gained, by chance up to {stage.limit:.2f}"
    if stage.fits:
        return f"{_capital(what)} {'fit' if verb == 'do' else 'fits'} {to} ({numbers})."
    kind = "control" if stage.name == CONTROL else "position"
    of_kind = [s for s in check.suspects if s.kind == kind] or [s for s in check.suspects if s.kind != "ray"]
    first = f"look at {suspect_text(of_kind[0])} first" if of_kind else "no single value stands out"
    offset = "" if kind == "control" else f" {_capital(_offset(check))}"
    return f"{_capital(what)} {verb} not fit {to} ({numbers}): {first}.{offset}".rstrip()


def _subjects(check: FreeCheck, stage: Stage) -> tuple[str, str]:
    """What is judged, and what it is held against."""
    if stage.name == CONTROL:
        return "the control", "the tie points"
    alone = not any(other.name == CONTROL for other in check.stages)
    if alone and len(check.point):
        return "the control and the observed positions", "the tie points"
    return "the observed positions", "the tie points" if alone else "the tie points and the control"


def _offset(check: FreeCheck) -> str:
    if check.position_offset is None:
        return "look at its σ, its coordinate system and its heights."
    x, y, z = (f"{value:+.{DECIMALS}f}" for value in check.position_offset)
    return f"on average they lie {x}, {y}, {z} m (X, Y, Z) from where the control alone puts the photographs."


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
