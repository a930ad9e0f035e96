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
class Suspect:
    """A value that contradicts the rest.

    Parameters
    ----------
    kind : 'ray', 'control', or the group of other observations. name : the point, photograph or condition. component :
        'X', 'x', 'omega' ….
    w : normalised residual. error : −v/r, m (rad for attitudes, mm for rays). error_px : pixels, of rays.
    """

    kind: str
    name: str
    component: str
    w: float
    error: float
    error_px: float = np.nan


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
    suspects : the first of the values with a large w, largest first; rays in the free block.
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
    suspects: tuple[Suspect, ...] = ()

    @property
    def tested(self) -> bool:
        return bool(np.isfinite(self.ratio))

    @property
    def fits(self) -> bool:
        """Neither all that was added together nor any single value of it contradicts."""
        return self.tested and self.ratio <= self.limit and not self.largest_w > self.w_limit


@dataclass(frozen=True, eq=False)
class FreeCheck:
    """Tie points or control?

    Parameters
    ----------
    stages : the adjustments, the free one first. sigma0_full : of the adjustment as delivered, NaN if there is none.
    spread : robust spread of w in the free block. beyond : rays whose |w| no chance explains.
    point : (k,) str, control points of the free block. similarity : onto their given coordinates, None if these do not
        determine it.
    position_offset : (3,) m, mean of observed positions less where control alone puts them; None if not known.
    robust : whether the weights are robust, so that the limits hold only approximately.
    """

    stages: tuple[Stage, ...]
    sigma0_full: float
    spread: float
    beyond: int
    point: np.ndarray
    similarity: Similarity | None
    position_offset: np.ndarray | None
    robust: bool = False

    @property
    def tie_points_poor(self) -> bool:
        return poor_fit(self.stages[0], self.spread)

    @property
    def verdict(self) -> str:
        """'fits', 'control', 'positions', 'tie points', 'both' (tie points and others), 'not tested' or 'failed'."""
        free, added = self.stages[0], self.stages[1:]
        if free.status != "converged":
            return "failed"
        against = [stage.name for stage in added if stage.status != "converged" or (stage.tested and not stage.fits)]
        if self.tie_points_poor:
            return "both" if against else "tie points"
        if against:
            alone = against == [POSITIONS] and any(stage.name == CONTROL for stage in added)
            return "positions" if alone else "control"
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
            parts.append("Robust weights are those of the free block: the limits hold approximately.")
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
    what = f"{given} {suspect.component}".rstrip()
    return f"{suspect.name}: {what} too {too} by {value} {unit} ({w})"


def _tie_points(check: FreeCheck) -> str:
    free = check.stages[0]
    stand_out = f"{check.beyond} ray{'s' if check.beyond != 1 else ''}"
    if free.redundancy <= 0:
        return "The tie points have no redundancy: nothing tests them."
    if not check.tie_points_poor:
        all_the_same = f"; {stand_out} stand{'s' if check.beyond == 1 else ''} out all the same" if check.beyond else ""
        return f"The tie points fit one another (σ0 free {free.sigma0:.2f}{all_the_same})."
    if free.sigma0 > INFLATED * check.spread and check.beyond:
        first = f" Look first at {suspect_text(free.suspects[0])}." if free.suspects else ""
        return (
            f"The tie points themselves do not fit (σ0 free {free.sigma0:.2f}, {free.sigma0 / check.spread:.1f} times "
            f"the spread of most residuals, {stand_out} beyond chance).{first}"
        )
    return (
        f"The tie points themselves do not fit (σ0 free {free.sigma0:.2f}) though few rays stand out: the a-priori σ "
        "of the image points is too small, or systematic image errors are not modelled."
    )


def _added(check: FreeCheck, stage: Stage) -> str:
    what, to, several = _subjects(check, stage)
    do_not_fit, fit = ("do not fit", "fit") if several else ("does not fit", "fits")
    if stage.status != "converged":
        return f"With {what} the adjustment has no result ({stage.status}: {stage.message})."
    if not stage.tested:
        return f"Nothing tests {what}: no redundancy is gained."
    numbers = f"vᵀPv grows by {stage.ratio:.2f} σ0² per redundancy gained, by chance up to {stage.limit:.2f}"
    if stage.fits:
        return f"{_capital(what)} {fit} {to} ({numbers})."
    return f"{_capital(what)} {do_not_fit} {to} ({numbers}). {_where_to_look(check, stage)}"


def _subjects(check: FreeCheck, stage: Stage) -> tuple[str, str, bool]:
    """What is judged, what it is held against, and whether the first is a plural."""
    if stage.name == CONTROL:
        return "the control", "the tie points", False
    if any(other.name == CONTROL for other in check.stages):
        return "the observed positions", "the tie points and the control", True
    if len(check.point):
        return "the control and the observed positions", "the tie points", True
    return "the observed positions", "the tie points", True


def _where_to_look(check: FreeCheck, stage: Stage) -> str:
    first = _first_suspect(check, stage)
    if stage.name == CONTROL or check.position_offset is None:
        return first
    x, y, z = (f"{value:+.{DECIMALS}f}" for value in check.position_offset)
    offset = f"On average they lie {x}, {y}, {z} m (X, Y, Z) from where the control alone puts the photographs."
    control = next(other for other in check.stages if other.name == CONTROL)
    # control that fitted the tie points and now complains is outvoted by a common error of the positions
    outvoted = control.fits and stage.suspects and stage.suspects[0].kind == "control"
    return offset if outvoted else f"{offset} {first}"


def _first_suspect(check: FreeCheck, stage: Stage) -> str:
    """The value to look at, or where to look when no single one explains the contradiction."""
    if stage.suspects and stage.largest_w > stage.w_limit:
        return f"Look first at {suspect_text(stage.suspects[0])}."
    largest = f" (the largest: {suspect_text(stage.suspects[0])})" if stage.suspects else ""
    shape = ""
    if check.similarity is not None:
        x, y, z = (f"{value:.{DECIMALS}f}" for value in check.similarity.rms)
        shape = f" Moved onto the control the free block is off by {x}, {y}, {z} m (RMS X, Y, Z)."
    return (
        f"No single value explains it{largest}.{shape} Look at σ, coordinate system and heights, and at systematic "
        "image errors that bend the free block."
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
