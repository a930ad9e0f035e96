"""Numbers and names as the report writes them; the rules they are judged by stand in `aerotri.diagnosis`."""

from __future__ import annotations

import numpy as np

from aerotri.diagnosis.check_points import GroundStatistics, asprs_warning, ground_statistics
from aerotri.diagnosis.finding import metre_digits, sigma0_by_group, sigma0_in_image

MANY_CELLS = 2.0
"""Cells of a median σ above which a surface or an orthophoto says so first; chosen [C]."""

__all__ = [
    "GroundStatistics", "asprs_warning", "ground_statistics", "many_cells", "metre_digits", "printable",
    "sigma0_by_group", "sigma0_in_image", "two_digits", "with_sigma",
]  # fmt: skip


def printable(name: object, longest: int = 200) -> str:
    """A name without control characters, so that it can neither move a terminal's cursor nor break a line."""
    text = "".join(c if c.isprintable() else " " for c in str(name))
    return text if len(text) <= longest else text[: longest - 1] + "…"


def with_sigma(value: float, sigma: float, signed: bool = False) -> str:
    """'8 308 ± 20', signed '+8 308 ± 20': both to two digits of σ, no digits before the point rounded."""
    digits = 0 if sigma <= 0.0 or not np.isfinite(sigma) else max(0, 1 - int(np.floor(np.log10(sigma))))
    plus = "+" if signed and value > 0.0 else ""
    return f"{plus}{value:,.{digits}f} ± {sigma:,.{digits}f}".replace(",", "\u2009").replace("-", "−")


def two_digits(value: float) -> str:
    """1 234 → '1 200', 0.0123 → '0.012'."""
    rounded = float(f"{value:.2g}")
    return (f"{rounded:,.0f}" if abs(rounded) >= 10.0 else f"{rounded:g}").replace(",", "\u2009").replace("-", "−")


def many_cells(what: str, sigma: float | None, cell: float) -> tuple[str, ...]:
    """A sentence where σ is many cells, none where it is not.

    Parameters
    ----------
    what : has it, such as 'heights'. sigma : its median, m, None where not known. cell : m.
    """
    if sigma is None or not sigma > MANY_CELLS * cell:
        return ()
    return (f"{what} have a σ of {two_digits(sigma)} m (median), which is {two_digits(sigma / cell)} cells",)
