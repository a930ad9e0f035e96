"""What data snooping removed: its list, and the block prepared anew without it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace

import numpy as np

from aerotri.adjustment.carry_over import start_values_at
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.prepare import Prepared, with_edits
from aerotri.adjustment.ray_status import RayStatus
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import State
from aerotri.functional_model.observed_unknowns import CentreObservations
from aerotri.observations import Block, GnssIns
from aerotri.results.adjusted_block import Blunder
from aerotri.strategies.switched_tests import AllTests, Switches, participants, photographs_of, ray_points

Found = Mapping[tuple[str, int, int], tuple[float, float]]
"""w and estimated error (mm, m or rad) of what was taken out, by kind ('ray', 'control', 'extra'), number and row."""


def with_tests_of(found: Found, which: Switches, tests: AllTests) -> Found:
    """The tests of some observations, kept for when they can be tested no more; where there is none, the old one."""
    parts = [("ray", 0, which.rays, tests.rays), ("control", 0, which.control, tests.control)]
    parts += [("extra", k, *both) for k, both in enumerate(zip(which.extras, tests.extras, strict=True))]
    out = dict(found)
    for kind, number, rows, test in parts:
        for row in np.flatnonzero(rows):
            axis = int(np.argmax(np.abs(test.w[row])))
            if test.w[row, axis] != 0.0 or (kind, number, int(row)) not in out:
                out[kind, number, int(row)] = float(test.w[row, axis]), float(test.error[row, axis])
    return out


def blunders_of(system: NormalSystem, gone: Switches, found: Found) -> tuple[Blunder, ...]:
    """The list of what was removed, largest |w| first."""
    u = system.unknowns
    images, points, point = u.block.images.names[u.images], u.block.points[u.points], ray_points(u)
    out = []
    for k in np.flatnonzero(gone.rays):
        w, error = found["ray", 0, int(k)]
        out.append(Blunder(str(images[u.rays.image[k]]), str(points[point[k]]), w, error, "removed"))
    for k in np.flatnonzero(gone.control):
        w, error = found["control", 0, int(k)]
        out.append(Blunder("", str(points[k]), w, 1e3 * error, "control removed"))
    for number, (extra, rows) in enumerate(zip(system.extras, gone.extras, strict=True)):
        is_position = isinstance(extra, CentreObservations)
        for k in np.flatnonzero(rows):
            w, error = found["extra", number, int(k)]
            image = str(images[photographs_of(extra)[k]])
            action = f"{'position' if is_position else 'attitude'} removed"
            out.append(Blunder(image, "", w, 1e3 * error if is_position else np.nan, action))
    return tuple(sorted(out, key=lambda blunder: -abs(blunder.w)))


def without_removed(prepared: Prepared, state: State, switches: Switches) -> Prepared:
    """The block prepared anew without what is switched off, beginning where the adjustment stands.

    A removed ray has the status REMOVED, one that is left alone in its point ONE_RAY; a removed control point is a
    check point; removed positions and attitudes are not observed. Coordinates held for the datum stay the same ones as
    long as their points do.
    """
    u = prepared.system.unknowns
    taking_part = participants(u, switches).rays
    status = prepared.ray_status.copy()
    status[u.rays.source[~taking_part]] = RayStatus.ONE_RAY
    status[u.rays.source[~switches.rays]] = RayStatus.REMOVED
    rows, axes = np.nonzero(u.point_held)
    still_there = np.isin(rows, ray_points(u)[taking_part]).all()
    held = list(zip(u.points[rows].tolist(), axes.tolist(), strict=True)) if len(rows) and still_there else None
    block = _with_less_datum(prepared.system, switches)
    return Prepared(*build_system(block, start_values_at(u, state), status, held), status, prepared.warnings)


def with_datum_of(block: Block, used: Block) -> Block:
    """A block with the control points, positions and attitudes left out that were removed from another form of it."""
    if block.settings.adjustment.robust != "data-snooping":
        return block
    was_check, is_check = (with_edits(b)[0].control.is_check for b in (block, used))
    block = _as_checks(block, block.control.point[is_check & ~was_check])
    gnss = block.gnss_ins
    if gnss is None:
        return block
    xyz_known, angles_known = (np.zeros((len(block.images), 3), dtype=bool) for _ in range(2))
    if used.gnss_ins is not None:
        xyz_known[used.gnss_ins.image] = np.isfinite(used.gnss_ins.xyz)
        angles_known[used.gnss_ins.image] = np.isfinite(used.gnss_ins.angles)
    xyz = np.where(xyz_known[gnss.image], gnss.xyz, np.nan)
    angles = np.where(angles_known[gnss.image], gnss.angles, np.nan)
    # a row that observes nothing is none
    rows = np.isfinite(np.concatenate([xyz, angles], axis=1)).any(axis=1)
    if not rows.any():
        return replace(block, gnss_ins=None)
    parts = {field.name: getattr(replace(gnss, xyz=xyz, angles=angles), field.name) for field in fields(gnss)}
    return replace(block, gnss_ins=GnssIns(**{name: part[rows] for name, part in parts.items()}))


def _as_checks(block: Block, points: np.ndarray) -> Block:
    """The block with control points made check points, also where the operator had made them control."""
    control, edits = block.control, block.edits
    control = replace(control, is_check=control.is_check | np.isin(control.point, points))
    if edits is not None:
        overruled = (edits.action == "control") & np.isin(edits.point, points)
        edits = replace(edits, action=np.where(overruled, "check", edits.action))
    return replace(block, control=control, edits=edits)


def _with_less_datum(system: NormalSystem, switches: Switches) -> Block:
    u = system.unknowns
    block = _as_checks(u.block, u.points[~switches.control])
    gnss = block.gnss_ins
    for extra, on in zip(system.extras, switches.extras, strict=True):
        if gnss is None or on.all():
            continue
        rows = np.isin(gnss.image, u.images[photographs_of(extra)[~on]])[:, None]
        if isinstance(extra, CentreObservations):
            gnss = replace(gnss, xyz=np.where(rows, np.nan, gnss.xyz))
        else:
            gnss = replace(gnss, angles=np.where(rows, np.nan, gnss.angles))
    return replace(block, gnss_ins=gnss)
