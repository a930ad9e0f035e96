"""Errors of simulated blocks over the σ that programs state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import aerotri
import default_choice
from aerotri import observations
from league_programs import colmap, ours
from league_programs.stated import AXES, ELEMENTS, INTERIOR, Stated
from league_programs.tables import LENS, cell, markdown, rms

SIMULATED = {"right": "no image errors beyond the lens", "drift": "a lens that changes along the flight"}
LAYOUT = "four corners and the middle"


def true_block(kind: str, seed: int) -> tuple[aerotri.Block, np.ndarray, np.ndarray, np.ndarray]:
    """A simulated block with a free interior orientation; true points, centres (m) and angles (rad)."""
    made = aerotri.simulate(default_choice.flight(True), seed=seed)
    block, rays = made.block, made.block.image_points
    if kind != "right":
        errors = default_choice.errors(kind, block, np.random.default_rng(seed))
        block = replace(block, image_points=replace(rays, xy=rays.xy + errors))
    free = {"focal_length_mm": observations.Prior(35.0), "x0_mm": observations.Prior(0.0),
            "y0_mm": observations.Prior(0.0)}  # fmt: skip
    block = replace(block, cameras=tuple(replace(camera, interior=free) for camera in block.cameras))
    points = np.column_stack([made.true_points[axis] for axis in AXES])
    centre = np.column_stack([made.true_images[name] for name in ELEMENTS[:3]])
    angles = np.radians(np.column_stack([made.true_images[name] for name in ELEMENTS[3:]]))
    return default_choice.held(block, LAYOUT), points, centre, angles


def errors_of(kind: str, seed: int) -> list[Stated]:
    """Error over stated σ of one simulated block, by program."""
    block, points, centre, angles = true_block(kind, seed)
    lens, default = (ours.adjusted(block, parameters, "off") for parameters in (LENS, "auto"))
    out = []
    for program, found in (("aerotri lens", lens), ("aerotri default", default)):
        if not isinstance(found, str):
            for total in (False, True):
                one = ours.stated(f"{program}, {'total' if total else 'noise'}", found, total)
                out.append(with_errors(one, found, points, centre, angles))
    if not isinstance(lens, str):
        same = colmap.stated(lens.record.local)
        out.append(with_errors(same, lens, points, centre, angles))
    return out


def with_errors(
    one: Stated, found: aerotri.Adjustment, points: np.ndarray, centre: np.ndarray, angles: np.ndarray
) -> Stated:
    """The column with the errors of the adjustment over its σ; of pycolmap too, whose solution is the same."""
    adjusted, block, errors = found.adjusted, found.block, {}
    turn = (adjusted.images.angles - angles + np.pi) % (2.0 * np.pi) - np.pi
    six = np.hstack([adjusted.images.centre - centre, np.degrees(turn)])
    for kind, names, rows, difference in (
        ("photographs", block.images.names, ELEMENTS, six),
        ("points", block.points, AXES, adjusted.points.xyz - points),
    ):
        sigma = getattr(one, kind)
        known = [k for k, name in enumerate(names.astype(str)) if name in sigma]
        ratio = difference[known] / np.array([sigma[str(names[k])] for k in known])
        errors |= {quantity: ratio[:, k] for k, quantity in enumerate(rows)}
    for camera in block.cameras:
        if camera.name in one.interior:
            rows = {str(n): v for n, v in zip(adjusted.parameters.names, adjusted.parameters.value, strict=True)}
            value = np.array([rows[name] for name in ours.ELEMENT_OF]) - [35.0, 0.0, 0.0]
            errors |= {quantity: (value / one.interior[camera.name])[k : k + 1] for k, quantity in enumerate(INTERIOR)}
    return replace(one, errors=errors)


def simulated_section(kind: str, blocks: int) -> list[str]:
    """Error over σ, all blocks of a kind together."""
    found: dict[str, list[Stated]] = {}
    for seed in range(1, blocks + 1):
        for one in errors_of(kind, seed):
            found.setdefault(one.program, []).append(one)
    rows = []
    for quantity in (*ELEMENTS, *AXES, *INTERIOR):
        cells = [quantity]
        for parts in found.values():
            there = [one.errors[quantity] for one in parts if quantity in one.errors]
            cells.append(cell(rms(np.concatenate(there))) if there else "")
        rows.append(cells)
    counts = ", ".join(f"{program}: {len(parts)}" for program, parts in found.items())
    text = (
        f"{blocks} flights of 40 photographs, {SIMULATED[kind]}; GNSS, five control points. Blocks adjusted: {counts}."
    )
    head = ["error over σ, RMS", *found]
    return [f"## Simulated: {SIMULATED[kind]}", "", text, "", *markdown(head, rows)]
