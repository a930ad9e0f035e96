"""What DBAT states in its report: deviations of photographs, camera and given points, σ̂0 included."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from league_programs.stated import ELEMENTS, Held, Stated, bare

ELEMENT_OF = {"Omega": "omega", "Phi": "phi", "Kappa": "kappa", "Xc": "X0", "Yc": "Y0", "Zc": "Z0"}
INTERIOR_OF = ("Camera Constant", "px - principal point x", "py - principal point y")
HEADING = "DBAT"


def stated(report: Path) -> Stated:
    """σ of a report."""
    lines = [line.rstrip() for line in report.read_text(encoding="utf-8").splitlines()]
    return Stated(HEADING, photographs=_photographs(lines), control=_control(lines), interior=_interior(lines),
                  held=_held(lines))  # fmt: skip


def sigma0(report: Path) -> float:
    """σ̂0 as printed."""
    return float(re.search(r"Sigma0:\s+(\S+)", report.read_text(encoding="utf-8"))[1])  # pyright: ignore


def _deviation(lines: list[str], at: int) -> float:
    """Of the quantity named in a line: NaN where it is held."""
    for line in lines[at + 1 : at + 3]:
        if found := re.match(r"\s+Deviation:\s+(\S+)", line):
            return float(found[1])
    return np.nan


def _photographs(lines: list[str]) -> dict[str, np.ndarray]:
    out: dict[str, np.ndarray] = {}
    name = ""
    for at, line in enumerate(lines):
        if found := re.match(r"\s+Photo \d+: (\S+)$", line):
            name = bare(found[1])
            out[name] = np.full(6, np.nan)
        elif name and (found := re.match(r"\s+(Omega|Phi|Kappa|Xc|Yc|Zc):$", line)):
            out[name][ELEMENTS.index(ELEMENT_OF[found[1]])] = _deviation(lines, at)
    return {name: sigma for name, sigma in out.items() if np.isfinite(sigma).all()}


def _interior(lines: list[str]) -> dict[str, np.ndarray]:
    """The one camera of the report; it has no name there."""
    out = np.full(3, np.nan)
    for at, line in enumerate(lines):
        for k, name in enumerate(INTERIOR_OF):
            if line.strip() == f"{name}:" and np.isnan(out[k]):
                out[k] = _deviation(lines, at)
    return {"": out} if np.isfinite(out).any() else {}


def _table(lines: list[str], section: str, table: str) -> dict[str, np.ndarray]:
    """Rows of 'Prior' or 'Posterior' of control or check points: x, y, z and their deviations by id."""
    at = next(k for k, line in enumerate(lines) if line.strip() == section)
    begin = next((k for k, line in enumerate(lines[at:], at) if line.strip() == table), None)
    out: dict[str, np.ndarray] = {}
    for line in lines[begin + 2 :] if begin is not None else []:
        cells = [cell.strip() for cell in line.split(",")]
        if len(cells) < 7:
            break
        out[cells[0]] = np.array([float(cell) for cell in cells[1:7]])
    return out


def _control(lines: list[str]) -> dict[str, np.ndarray]:
    """Control points: the report has no deviations of single other points."""
    return {name: row[3:] for name, row in _table(lines, "Ctrl measurements", "Posterior").items()}


def _held(lines: list[str]) -> Held | None:
    given = _table(lines, "Check measurements", "Prior")
    found = _table(lines, "Check measurements", "Posterior")
    names = [name for name in given if name in found]
    if not names:
        return None
    before, after = (np.array([table[name] for name in names]) for table in (given, found))
    return Held(after[:, :3] - before[:, :3], after[:, 3:], before[:, 3:])
