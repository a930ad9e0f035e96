"""Tables of what programs state about one block, in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from league_programs import pix4d
from league_programs.stated import AXES, ELEMENTS, INTERIOR, Held, Stated

BASE = "aerotri lens, noise"
LENS = "lens:k1+k2+p1+p2+k3"
"""Parameters that all programs have."""
UNITS = {**dict.fromkeys(ELEMENTS[:3], "m"), **dict.fromkeys(ELEMENTS[3:], "°"), **dict.fromkeys(AXES, "m"),
         **dict.fromkeys(INTERIOR, "mm")}  # fmt: skip
KINDS = {"photographs": "photographs", "points": "points", "control": "control points", "interior": "cameras"}
QUANTITIES = {"photographs": ELEMENTS, "points": AXES, "control": AXES, "interior": INTERIOR}


@dataclass(frozen=True)
class Found:
    """The columns of a block, and what is said about them."""

    columns: tuple[Stated, ...]
    notes: tuple[str, ...] = field(default=())


def shared(columns: Sequence[Stated], kind: str) -> dict[str, np.ndarray]:
    """σ (k, 3) or (k, 6) by program, of the names that all columns with this kind have; what is held is left out."""
    own = {one.program: of_kind(one, kind, columns) for one in columns}
    own = {program: found for program, found in own.items() if found}
    known = set.intersection(*(set(found) for found in own.values())) if BASE in own else set()
    names = sorted(name for name in known if (own[BASE][name] > 0.0).any())
    return {program: np.array([found[name] for name in names]) for program, found in own.items()} if names else {}


def of_kind(one: Stated, kind: str, columns: Sequence[Stated]) -> Mapping[str, np.ndarray]:
    """σ by name; of control only where a program states nothing else."""
    if kind != "control" or one.control or not any(other.control for other in columns):
        return getattr(one, kind)
    return one.points


def with_one_camera(columns: Sequence[Stated]) -> list[Stated]:
    """A report without the name of its only camera: it is that of ours."""
    name = next(iter(columns[0].interior), None)
    return [replace(one, interior={name: one.interior[""]}) if "" in one.interior and name else one for one in columns]


def sigma_tables(found: Found) -> list[str]:
    """Medians of σ, and medians of the ratios."""
    columns = with_one_camera(found.columns)
    heads = [one.program for one in columns]
    medians, ratios = [], []
    for kind, title in KINDS.items():
        table = shared(columns, kind)
        for k, quantity in enumerate(QUANTITIES[kind] if table else ()):
            text = f"σ {quantity}, {UNITS[quantity]}"
            own = {head: table[head][:, k] for head in heads if head in table}
            medians.append([text, f"{len(table[BASE])} {title}", *(cell(median(own.get(head))) for head in heads)])
            ratios.append([text, title, *(cell(ratio(own.get(head), own[BASE])) for head in heads)])
    if not medians:
        return []
    out = ["", "Median σ:", "", *markdown(["quantity", "of", *heads], medians)]
    return [*out, "", f"Over {BASE} (median of the ratios):", "", *markdown(["quantity", "of", *heads], ratios)]


def median(values: np.ndarray | None) -> float:
    return float(np.nanmedian(values)) if values is not None and np.isfinite(values).any() else np.nan


def ratio(values: np.ndarray | None, base: np.ndarray) -> float:
    """Median of the ratios, where the base is not held."""
    free = base > 0.0
    return median(values[free] / base[free]) if values is not None and free.any() else np.nan


def cell(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else ""


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def short_table(found: Found) -> list[str]:
    """Our σ, and the others' over it: the essence of both tables, for the page."""
    columns = with_one_camera(found.columns)
    heads = [one.program for one in columns if one.program != BASE]
    rows = []
    for kind, title in KINDS.items():
        table = shared(columns, kind)
        for k, quantity in enumerate(QUANTITIES[kind] if table else ()):
            own = {head: sigma[:, k] for head, sigma in table.items()}
            over = (cell(ratio(own.get(head), own[BASE])) for head in heads)
            text = f"{quantity}, {UNITS[quantity]}"
            rows.append([text, f"{len(table[BASE])} {title}", cell(median(own[BASE])), *over])
    return markdown(["σ of", "median of", BASE, *(f"{head}: ratio" for head in heads)], rows) if rows else []


def held_table(found: Found) -> list[str]:
    """Errors at points that took no part, over what is stated."""
    rows = []
    for one in found.columns:
        if one.held is not None:
            rows.append([one.program, str(len(one.held.difference)), *held_cells(one.held)])
    head = ["program", "points", "RMS dX dY m", "over σ", "with given σ", "RMS dZ m", "over σ", "with given σ"]
    return ["", "Points held back:", "", *markdown(head, rows)] if rows else []


def held_cells(held: Held) -> list[str]:
    cells = []
    for axes in (slice(0, 2), slice(2, 3)):
        d, s, g = (part[:, axes] for part in (held.difference, held.sigma, held.given))
        cells += [cell(rms(d)), cell(rms(d / s)), cell(rms(d / np.hypot(s, g)))]
    return cells


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return ["| " + " | ".join(line) + " |" for line in lines]


def correlation_table(data: Path) -> list[str]:
    """The largest correlations that Pix4D states for a camera."""
    rows = []
    for folder in ("cu_sbr_p1", "ca502", "share5"):
        for camera, names, matrix in pix4d.correlations(data / folder):
            k, j = divmod(int(np.argmax(np.abs(np.triu(matrix, 1)))), len(names))
            f = 1 + int(np.argmax(np.abs(matrix[0, 1:])))
            rows.append([folder, camera, f"{names[k]}–{names[j]}", f"{matrix[k, j]:.3f}", names[f],
                         f"{matrix[0, f]:.3f}"])  # fmt: skip
    head = ["block", "camera", "largest", "correlation", "largest with F", "correlation"]
    return ["## Correlations of the interior orientation, as Pix4D states them", "", *markdown(head, rows)]
