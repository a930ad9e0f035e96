"""Errors of the matching that neighbouring cells share over many windows, so that means over areas keep them.

Windows on curved ground, what interpolation moves and the smoothing of parallaxes leave errors that are far below the σ
of a cell and do not average out as noise does.
"""

from __future__ import annotations

LASTING_PX, LASTING_LENGTH_PX = 0.0005, 50.0
"""RMS, pixels of parallax, and distance, pixels on the ground, over which their correlation falls to 1/e; chosen [C]:
with these the means over squares of 10 to 80 cells of rendered scenes with little noise, two draws of each, are within
their σ, of which the noise that cells share is most; two others hold (tools/prove/dense_surface.py)."""


def lasting_errors(pixel: float, gsd: float) -> tuple[float, float]:
    """σ of a height, m, and correlation length, m.

    Parameters
    ----------
    pixel : m of height that a pixel of parallax is. gsd : m, pixel on the ground of the level that was matched.
    """
    return LASTING_PX * pixel, LASTING_LENGTH_PX * gsd
