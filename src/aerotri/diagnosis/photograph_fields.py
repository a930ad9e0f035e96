"""Smooth errors of single photographs, in words."""

from __future__ import annotations

from aerotri.diagnosis.finding import Finding
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.photograph_fields import PhotographFields


def photograph_fields_in_words(found: PhotographFields | None) -> str:
    """What a specialist has to know of them, '' where nobody asked."""
    if found is None or found.reason:
        return ""
    if found.source == "given":
        return f"image points of a photograph have errors in common: {_size(found)}, as given in block.toml"
    chance = f"{100.0 * found.p:.2g} %" if found.p >= 1e-5 else "less than 0.001 %"
    if found.counts:
        return (
            f"image points of a photograph have errors in common, other ones in every photograph: {_size(found)} "
            f"(estimated; by chance with a probability of {chance}). They are part of the σ"
        )
    return (
        "image points of a photograph show no smooth errors in common (by chance with a probability of "
        f"{chance}): they were adjusted as independent"
    )


def of_photograph_fields(adjusted: AdjustedBlock) -> list[Finding]:
    """Their size and the test."""
    found = adjusted.photograph_fields
    if found is None or found.reason:
        return []
    name, expected = "smooth errors of single photographs", "beside the noise of single image points"
    if found.counts:
        return [Finding(name, _size(found), expected, photograph_fields_in_words(found), "note")]
    return [Finding(name, "none", expected, "image points are independent", "good")]


def _size(found: PhotographFields) -> str:
    return f"σ {found.sigma_um:.2g} µm, alike over {found.length_mm:.2g} mm"
