"""A two-dimensional Fourier series over the format.

[C] With u = πx/bx and v = πy/by: dx = Σ_{m=1..M} Σ_{n=−N..N} (a·cos(mu + nv) + b·sin(mu + nv)) + Σ_{n=1..N} (a·cos nv +
b·sin nv), dy with coefficients of its own: 16 parameters for M = N = 1, millimetres. An item such as ``xs2m1`` says the
axis of the displacement (x or y), cosine or sine (c or s), m, the sign of n (p or m) and |n|: dx = sin(2u − v).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from aerotri.functional_model.additional_parameters.family import Family
from aerotri.functional_model.additional_parameters.sizes import Sizes
from aerotri.functional_model.additional_parameters.terms import Terms, dense_terms
from aerotri.observations import Camera

LARGEST = (6, 6)
"""Orders offered at most [C]: 336 parameters, whose shortest wave is a sixth of the format; finer image errors are for
the random field."""


def _waves(m: int, n: int) -> list[tuple[int, int]]:
    """Wave numbers (m, n) of a series, from long waves to short ones."""
    waves = [(i, j) for i in range(m + 1) for j in range(-n, n + 1) if i > 0 or j > 0]
    return sorted(waves, key=lambda w: (max(w[0], abs(w[1])), w[0] + abs(w[1]), -w[0], -w[1]))


def _item_name(axis: str, function: str, m: int, n: int) -> str:
    return f"{axis}{function}{m}{'p' if n >= 0 else 'm'}{abs(n)}"


@cache
def items_of_order(m: int, n: int) -> tuple[str, ...]:
    """Items of the series of order m × n."""
    return tuple(_item_name(axis, function, *wave) for wave in _waves(m, n) for axis in "xy" for function in "cs")


def _angle_text(m: int, n: int) -> str:
    along_x = "" if m == 0 else "u" if m == 1 else f"{m}u"
    along_y = "" if n == 0 else "v" if abs(n) == 1 else f"{abs(n)}v"
    sign = "" if not along_x or not along_y else " + " if n > 0 else " − "
    return along_x + sign + along_y


WAVES = {
    _item_name(axis, function, *wave): (axis, function, *wave)
    for wave in _waves(*LARGEST)
    for axis in "xy"
    for function in "cs"
}
"""Axis, function and wave numbers of every item."""
SIZES = Sizes("order in x and in y", (1, 1), (1, 1), LARGEST, items_of_order)
"""Order 1 × 1 unless another is asked for [C]: 16 parameters, about as many as the sets of the literature."""
DESCRIPTION = {
    item: f"d{axis} = {'cos' if function == 'c' else 'sin'}({_angle_text(m, n)})"
    for item, (axis, function, m, n) in WAVES.items()
}


def _powers(angle: np.ndarray, highest: int) -> np.ndarray:
    """(highest + 1, n) exp(i·k·angle) for k = 0 … highest."""
    power = np.ones((highest + 1, len(angle)), dtype=complex)
    unit = np.exp(1j * angle)
    for k in range(highest):
        power[k + 1] = power[k] * unit
    return power


def _evaluate(camera: Camera, x: np.ndarray, y: np.ndarray, partials: bool, items: tuple[str, ...]) -> Terms:
    """Waves at image points."""
    chosen = [WAVES[item] for item in items]
    per_mm = np.pi / np.array(camera.half_format_mm)
    highest_m = max((m for _, _, m, _ in chosen), default=0)
    highest_n = max((abs(n) for _, _, _, n in chosen), default=0)

    def fill(x: np.ndarray, y: np.ndarray, value: np.ndarray, partial: np.ndarray | None) -> None:
        along_x, along_y = _powers(per_mm[0] * x, highest_m), _powers(per_mm[1] * y, highest_n)
        for k, (letter, function, m, n) in enumerate(chosen):
            axis, wave = "xy".index(letter), along_x[m] * (along_y[n] if n >= 0 else along_y[-n].conj())
            value[:, axis, k] = wave.real if function == "c" else wave.imag
            if partial is not None:
                slope = -wave.imag if function == "c" else wave.real
                partial[:, axis, k] = slope[:, None] * (per_mm * (m, n))

    return dense_terms(x, y, len(chosen), partials, fill)


FAMILY = Family(
    name="fourier",
    items=tuple(WAVES),
    mark="C",
    reference="Two-dimensional Fourier series over the format; composition of this project",
    text=DESCRIPTION.__getitem__,
    unit=lambda _: "mm",
    evaluate=_evaluate,
    default_items=SIZES.items(SIZES.default),
    sizes=SIZES,
)
