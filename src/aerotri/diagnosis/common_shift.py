"""A shift of all observed positions against the control points, in words."""

from __future__ import annotations

from aerotri.diagnosis.finding import Finding, doubt
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.common_shift import CommonShift

DOUBTFUL = 1e-5
"""[C] Probability below which a result with such a shift is doubtful; more is worth a warning alone."""
SETTING = 'shift = "block" in [gnss] of block.toml'


def common_shift_in_words(found: CommonShift | None) -> str:
    """What to tell the user; '' where there is none or chance explains it."""
    if found is None or not found.counts:
        return ""
    chance = f"{100.0 * found.p:.2g} %" if found.p >= 1e-5 else "less than 0.001 %"
    return (
        f"all GNSS positions are shifted against the control points: {_size(found)}; by chance with a probability of "
        f"{chance}. The adjustment takes their errors for independent, so the shift pulls at the block, "
        f"and σ may be too small. Set {SETTING}"
    )


def of_common_shift(adjusted: AdjustedBlock) -> list[Finding]:
    """Positions that contradict the control points as a whole make σ too small."""
    found = adjusted.common_shift
    if found is None:
        return []
    name, expected, said = "shift of GNSS against control", "0 within its σ", common_shift_in_words(found)
    if not found.counts:
        return [Finding(name, _size(found), expected, "positions and control points agree", "good")]
    if found.p >= DOUBTFUL:
        return [Finding(name, _size(found), expected, said, "attention")]
    return doubt(name, _size(found), expected, "doubtful", said)


def _size(found: CommonShift) -> str:
    return ", ".join(
        f"{axis} {value:+.3f} m (σ {sigma:.3f})"
        for axis, value, sigma in zip("XYZ", found.shift, found.sigma, strict=True)
    )
