"""What a result is good for: places in the coordinate system, the shape alone, or neither; with the numbers.

A block that nothing good holds has a σ of metres although its shape is known to centimetres. Both are said: the first
is for maps and for heights above a datum, the second for lengths, slopes of the ground against one another and volumes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.diagnosis.geometry import usual_distance
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.relative import RelativePrecision, medians

ABSOLUTE, RELATIVE, NEITHER = "absolute", "relative", "neither"
PIXELS = 10.0
"""Pixels on the ground that σ may be for a result to be good for something; chosen [C]: a photograph shows details to a
pixel or two, and control or GNSS with corrections give a block some pixels. GNSS of metres gives it hundreds."""
IN_DOUBT = "By its σ, which are in doubt: g"
"""What a sentence on a doubtful result begins with, in place of its first letter."""
WORTH_SAYING = 5e-4
"""σ of the scale from which it is said; chosen [C]: 5 cm of 100 m, 0.15 % of a volume."""
NO_BETTER = 0.95
"""Share of σ of the places from which on the relative one is not said to be better; chosen [C]."""
PER_VOLUME = 3.0
"""A volume errs by three times the scale."""


@dataclass(frozen=True)
class Purpose:
    """What a result is good for.

    Parameters
    ----------
    good_for : ABSOLUTE (places in the coordinate system, and so the shape too), RELATIVE (the shape alone) or NEITHER;
        '' where it is not known. says : a sentence or two with the numbers.
    """

    good_for: str = ""
    says: str = ""


def purpose(adjusted: AdjustedBlock) -> Purpose:
    """What a judged result is good for, by the medians of its total σ over the object points, beside its pixels.

    Parameters
    ----------
    adjusted : in metres, in the frame of the adjustment; with its verdict.
    """
    relative, pixel = adjusted.relative, ground_pixel(adjusted)
    if adjusted.outcome.verdict == "rejected":
        return Purpose(NEITHER, "A rejected result serves only to find the error.")
    if relative is None or not np.isfinite(pixel) or not np.isfinite(relative.medians).all():
        return Purpose()
    free = not np.isfinite(relative.position).all()
    place = np.full(3, np.nan) if free else medians(adjusted.points.total_sigma)
    if (place <= PIXELS * pixel).all():
        found = Purpose(ABSOLUTE, _absolute(place, relative))
    elif (relative.medians <= PIXELS * pixel).all():
        found = Purpose(RELATIVE, _relative(place, relative))
    else:
        found = Purpose(NEITHER, _neither(relative, pixel))
    return found if adjusted.outcome.verdict == "accepted" else replace(found, says=f"{IN_DOUBT}{found.says[1:]}")


def beside_verdict(verdict: str, good_for: str) -> str:
    """What stands behind the word of the verdict, as in 'accepted, for its shape only'; '' where it says all."""
    if verdict == "rejected":
        return ""
    return {RELATIVE: ", for its shape only", NEITHER: ", with a large σ"}.get(good_for, "")


def ground_pixel(adjusted: AdjustedBlock) -> float:
    """m, a pixel at the usual distance of the points; NaN where nothing was adjusted."""
    sizes = [1e-3 * c.pixel_um / c.focal_length_mm for c in adjusted.block.cameras]
    return usual_distance(adjusted) * float(np.median(sizes)) if sizes else float("nan")


def _absolute(place: np.ndarray, relative: RelativePrecision) -> str:
    return (
        f"Good for positions and heights in the coordinate system: X and Y {plus_minus(_plan(place))}, heights "
        f"{plus_minus(place[2])} (σ, median of the points). {_beside_places(place, relative)}"
    )


def _beside_places(place: np.ndarray, relative: RelativePrecision) -> str:
    """The shape, where it is known better than the places: few points beside control tell a similarity no better."""
    left = relative.medians
    if left[2] > NO_BETTER * place[2] and _plan(left) > NO_BETTER * _plan(place):
        return "Relative to one another they are known no better."
    return _of_shape(relative)


def _relative(place: np.ndarray, relative: RelativePrecision) -> str:
    first = f"Good for its shape only. {_of_shape(relative)}"
    if not np.isfinite(place).all():
        return f"{first} Nothing says where the block lies, how it is turned and how large it is."
    tilt = f", tilt {plus_minus(np.degrees(relative.tilt), '°')}" if np.isfinite(relative.tilt) else ""
    return (
        f"{first} In the coordinate system positions are known to {plus_minus(_plan(place))} and heights to "
        f"{plus_minus(place[2])}{tilt}. Control points or GNSS with corrections (RTK, PPK) make them better."
    )


def _neither(relative: RelativePrecision, pixel: float) -> str:
    left = relative.medians
    worst = float(left.max())
    return (
        f"Good for neither positions nor shape: even relative to one another heights have {plus_minus(left[2])}, X and "
        f"Y {plus_minus(_plan(left))}, up to {worst / pixel:.0f} pixels on the ground. Parameters that are held or "
        "better known, more overlap or control points make them smaller."
    )


def _of_shape(relative: RelativePrecision) -> str:
    left = relative.medians
    return (
        f"Relative to one another, after a shift, rotation and scale of the whole, heights have {plus_minus(left[2])}, "
        f"X and Y {plus_minus(_plan(left))}{scale_text(relative.scale)}."
    )


def scale_text(scale: float) -> str:
    """'; the scale is known to ± 0.4 %, a volume so to ± 1.2 %', '' where it is known well or not at all."""
    if not scale > WORTH_SAYING:
        return ""
    return f"; the scale is known to {_percent(scale)}, and with it a volume to {_percent(PER_VOLUME * scale)}"


def _percent(share: float) -> str:
    return plus_minus(100.0 * share, " %")


def _plan(sigma: np.ndarray) -> float:
    """The larger of X and Y."""
    return float(sigma[:2].max())


def plus_minus(value: float, unit: str = "") -> str:
    """'± 3.1 cm', '± 9.2 m', '± 0.42 mm': a length in the unit that suits it, or a number with its own."""
    if unit:
        return f"± {float(f'{value:.2g}'):g}{unit}"
    for factor, name in ((1.0, "m"), (100.0, "cm"), (1000.0, "mm")):
        if value * factor >= 1.0 or name == "mm":
            return f"± {float(f'{value * factor:.2g}'):g} {name}"
    raise AssertionError("a length has a unit")
