"""Tables of the report about rigs: where the cameras sit, and whether they keep their places."""

from __future__ import annotations

import numpy as np

from aerotri.diagnosis.rigidity import ARC_SECONDS, camera_verdicts
from aerotri.report.quality import printable
from aerotri.report.tables.adjustment import Column, Table
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.rigidity import ROTATION

ELEMENTS = ("x", "y", "z", "ω", "φ", "κ")
TOP_PHOTOGRAPHS = 15
"""Photographs that are listed [C]: all are in rig_stations.csv."""
LEAST_P = 1e-5
"""Probability that is given as 0 below [C]: no model of errors is true to that."""


def rigs_table(adjusted: AdjustedBlock) -> Table:
    """Position and rotation of the cameras on rigs with their σ."""
    rows = []
    for one in adjusted.rigs:
        degrees, sigma = np.degrees(one.angles), one.sigma
        cells = [value for k in range(3) for value in (one.position[k], 1e3 * sigma[k])]
        cells += [value for k in range(3) for value in (degrees[k], ARC_SECONDS * sigma[3 + k])]
        strongest = _strongest(one.correlations)
        rows.append((printable(one.rig), printable(one.camera), *(float(v) for v in cells), strongest, one.stations))
    columns = [Column("rig"), Column("camera")]
    for name in "xyz":
        columns += [Column(name, "m", ".4f"), Column("σ", "mm", ".1f")]
    for name in ("ω", "φ", "κ"):
        columns += [Column(name, "°", ".4f"), Column("σ", "″", ".1f")]
    columns += [Column("largest ρ"), Column("photographs", "", "d")]
    return Table("Cameras on rigs", tuple(columns), tuple(rows))


def _strongest(correlations: np.ndarray) -> str:
    """The two elements that are correlated most, and how."""
    off = np.nan_to_num(np.triu(correlations, 1))
    i, j = np.unravel_index(int(np.argmax(np.abs(off))), off.shape)
    return f"{ELEMENTS[i]}, {ELEMENTS[j]}: {off[i, j]:+.2f}" if off.any() else "–"


def movements_table(adjusted: AdjustedBlock) -> Table:
    """σ of the movements of cameras on weighted rigs."""
    rows, moves = [], adjusted.rig_movements
    for k in range(len(moves.camera) if moves is not None else 0):
        assert moves is not None
        estimated = moves.estimated is not None and bool(moves.estimated[k].any())
        (position, rotation), (s_position, s_rotation) = moves.sigma[k], moves.sigma_sigma[k]
        rows.append((
            printable(moves.rig[k]), printable(moves.camera[k]), float(ARC_SECONDS * rotation),
            float(ARC_SECONDS * s_rotation), float(1e3 * position), float(1e3 * s_position),
            "estimated" if estimated else "stated", int(np.sum(moves.of == k)),
        ))  # fmt: skip
    columns = (
        Column("rig"), Column("camera"), Column("rotation σ", "″", ".2f"), Column("±", "″", ".2f"),
        Column("position σ", "mm", ".2f"), Column("±", "mm", ".2f"), Column("how"), Column("photographs", "", "d"),
    )  # fmt: skip
    return Table("Movements of the cameras between exposures", columns, tuple(rows))


def rigidity_table(adjusted: AdjustedBlock) -> Table:
    """The tests of movements and drifts, two rows a camera."""
    rows, tests = [], adjusted.rigidity
    for one in () if tests is None else tests.heads:
        unit = ARC_SECONDS if one.what == ROTATION else 1e3
        known = np.isfinite(one.drift_sigma).all()
        worst = int(np.argmax(np.abs(one.drift / one.drift_sigma))) if known else 0
        rows.append((
            printable(one.camera), one.what, "″" if one.what == ROTATION else "mm", one.stations,
            one.movement * unit, one.movement_sigma * unit, one.movement_detectable * unit, _percent(one.movement_p),
            "yes" if one.movement_found else "no", f"{'xyz'[worst]}", float(one.drift[worst] * unit),
            float(one.drift_sigma[worst] * unit), _percent(one.drift_p), "yes" if one.drift_found else "no",
        ))  # fmt: skip
    columns = (
        Column("camera"), Column("what"), Column("unit"), Column("photographs", "", "d"),
        Column("movement σ", "", ".2f"), Column("±", "", ".2f"), Column("detectable σ", "", ".2f"),
        Column("p", "%", ".2g"),
        Column("moves"), Column("axis"), Column("drift", "", "+.2f"), Column("±", "", ".2f"), Column("p", "%", ".2g"),
        Column("drifts"),
    )  # fmt: skip
    return Table("Do the cameras keep their places?", columns, tuple(rows))


def photographs_table(adjusted: AdjustedBlock) -> Table:
    """The photographs that fit the place that rig and station give them least."""
    rows, tests = [], adjusted.rigidity
    if tests is not None:
        s = tests.stations
        for k in np.argsort(s.p, kind="stable")[:TOP_PHOTOGRAPHS].tolist():
            turned = [value for pair in zip(s.turned[k], s.sigma[k], strict=True) for value in pair]
            rows.append((
                printable(adjusted.block.images.names[s.image[k]]), printable(s.camera[k]),
                *(float(ARC_SECONDS * value) for value in turned), float(s.f[k]), int(s.freedom[k]),
                _percent(float(s.p[k])), "yes" if s.found[k] else "no",
            ))  # fmt: skip
    columns = [Column("photograph"), Column("camera")]
    for name in "xyz":
        columns += [Column(f"turned {name}", "″", "+.1f"), Column("σ", "″", ".1f")]
    columns += [Column("F", "", ".2f"), Column("freedom", "", "d"), Column("p", "%", ".2g"), Column("found")]
    return Table("Photographs that fit their place on the rig least", tuple(columns), tuple(rows))


def stations_table(adjusted: AdjustedBlock) -> Table:
    """The exposures whose photographs fit one another on the rig least."""
    rows, tests = [], adjusted.rigidity
    if tests is not None:
        s = tests.whole
        for k in np.argsort(s.p, kind="stable")[:TOP_PHOTOGRAPHS].tolist():
            rows.append((
                printable(s.rig[k]), printable(s.station[k]), int(s.photographs[k]), float(s.f[k]), int(s.freedom[k]),
                _percent(float(s.p[k])), "yes" if s.found[k] else "no",
            ))  # fmt: skip
    columns = (
        Column("rig"), Column("station"), Column("photographs", "", "d"), Column("F", "", ".2f"),
        Column("freedom", "", "d"), Column("p", "%", ".2g"), Column("found"),
    )  # fmt: skip
    return Table("Exposures that fit the rig least", columns, tuple(rows))


def verdicts(adjusted: AdjustedBlock) -> list[dict[str, str]]:
    """A light and a sentence a camera."""
    tests = adjusted.rigidity
    return [
        {"level": "good" if one.keeps else "attention", "sentence": printable(_capital(one.says), 1000)}
        for one in (() if tests is None else camera_verdicts(tests))
    ]


def _percent(p: float) -> float:
    """In percent."""
    return 100.0 * p if p >= LEAST_P else 0.0


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:] + "."
