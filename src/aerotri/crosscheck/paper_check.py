"""Our adjustment against an independent one: forward model from the papers, self-calibration included."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from aerotri.crosscheck.comparison import Difference, PeerCheck, difference, judge
from aerotri.crosscheck.freed import used_rays, with_fixed_weights
from aerotri.crosscheck.paper_block import PaperBlock, UnknownToPaperError, paper_block
from aerotri.crosscheck.paper_rays import angles_of
from aerotri.crosscheck.paper_system import PaperSolution, solve_normal_equations
from aerotri.crosscheck.paper_unknowns import KnownSolution, Layout, lay_out, rotations
from aerotri.crosscheck.pattern_check import compare_patterns
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock, SharedParameters

PEER = "independent model"
QUESTION = "all unknowns with the forward model written from the papers alone, self-calibration included"
FAR_OFF = 50.0
"""Residual in σ from which a ray keeps its measured position, as the adjustment has it."""
ELEMENTS = ("X0", "Y0", "Z0", "omega", "phi", "kappa")
OWNERS = {"interior": "camera", "additional": "group", "gnss": "gnss"}
"""What the entries of a kind of parameters belong to."""
KINDS = {"interior": "interior orientation", "additional": "additional parameters", "gnss": "GNSS shifts and drifts"}


def check_with_paper(adjusted: AdjustedBlock, adjust: Callable[[Block], AdjustedBlock]) -> PeerCheck:
    """Adjust the block independently, from a start away from the solution, and compare all unknowns.

    Parameters
    ----------
    adjust : our adjustment, for a robust one is repeated with its final weights.
    """
    notes = []
    if adjusted.block.settings.adjustment.robust != "off":
        adjusted = adjust(with_fixed_weights(adjusted))
        notes.append("ours adjusted again by least squares with the final weights of the robust estimation")
    origin = np.round(np.nanmean(adjusted.images.centre, axis=0))
    begun = time.perf_counter()
    try:
        paper = paper_block(
            adjusted.block,
            used_rays(adjusted),
            adjusted.rays.weight,
            origin,
            _positions(adjusted),
            _removed(adjusted.parameters),
        )
    except UnknownToPaperError as unknown:
        return PeerCheck(PEER, QUESTION, "not available", str(unknown), checks_parameters=True)
    layout, start = lay_out(paper, _known(adjusted, paper))
    solution = _solve(paper, layout, start)
    check = PeerCheck(
        PEER,
        QUESTION,
        status="not converged",
        reason=f"{solution.solver} stopped after {solution.iterations} iterations",
        solver=solution.solver,
        iterations=solution.iterations,
        seconds=time.perf_counter() - begun,
        observations=paper.observations,
        unknowns=int(layout.free.sum()),
        vtpv=adjusted.outcome.vtpv,
        vtpv_peer=solution.vtpv,
        differences=_differences(adjusted, paper, layout, solution.x),
        patterns=compare_patterns(adjusted, paper, adjusted_entries(adjusted, paper)),
        checks_parameters=True,
        notes=(*notes, *_notes(adjusted, solution)),
    )
    return judge(check, _counts_differ(adjusted, check)) if solution.converged else check


def _positions(adjusted: AdjustedBlock) -> np.ndarray | None:
    """(m, 2) mm, where the adjustment evaluates its parameters: adjusted image points; None: the measured ones.

    A ray far off stays where it was measured, as there.
    """
    rays, v = adjusted.block.image_points, adjusted.rays.v
    if adjusted.block.settings.adjustment.parameter_position == "measured":
        return None
    near = np.all(np.abs(v) <= FAR_OFF * rays.sigma, axis=1, keepdims=True)
    return np.where(near, rays.xy + v, rays.xy)


def _removed(parameters: SharedParameters) -> frozenset[tuple[str, str]]:
    rows = np.flatnonzero(parameters.status == "removed")
    return frozenset((str(parameters.names[k]), str(parameters.groups[k])) for k in rows)


def _counts_differ(adjusted: AdjustedBlock, check: PeerCheck) -> list[str]:
    """Observations and unknowns that one of the two does not have; the conditions of an inner datum are not counted."""
    o = adjusted.outcome
    pairs = (
        ("observations", o.observations, check.observations),
        ("unknowns", o.unknowns - o.conditions, check.unknowns),
    )
    return [f"{what}: ours {ours}, independently {peer}" for what, ours, peer in pairs if ours != peer]


def _notes(adjusted: AdjustedBlock, solution: PaperSolution) -> list[str]:
    notes = []
    if solution.solver == "SciPy":
        notes.append("pyceres is not installed: solved by SciPy's sparse factor (pip install 'aerotri[ceres]')")
    if adjusted.block.settings.adjustment.is_free:
        notes.append("datum: seven point coordinates held at our values")
    return notes


def _solve(paper: PaperBlock, layout: Layout, start: np.ndarray) -> PaperSolution:
    try:
        from aerotri.crosscheck.ceres_solver import solve_with_ceres
    except ImportError:
        return solve_normal_equations(paper, layout, start)
    return solve_with_ceres(paper, layout, start)


def _known(adjusted: AdjustedBlock, paper: PaperBlock) -> KnownSolution:
    settings = adjusted.block.settings.adjustment
    held = np.zeros((len(paper.images), 6), dtype=bool)
    if settings.datum == "fixed":
        row = {str(name): k for k, name in enumerate(adjusted.block.images.names[paper.images])}
        for image, element in settings.datum_fixed:
            if image in row:
                held[row[image], ELEMENTS.index(element)] = True
    return KnownSolution(
        centre=adjusted.images.centre[paper.images] - paper.origin,
        angles=adjusted.images.angles[paper.images],
        points=adjusted.points.xyz[paper.points] - paper.origin,
        held_poses=held,
        datum_free=settings.is_free,
    )


def _differences(adjusted: AdjustedBlock, paper: PaperBlock, layout: Layout, x: np.ndarray) -> tuple[Difference, ...]:
    block, images, points = adjusted.block, adjusted.images, adjusted.points
    names = block.images.names[paper.images]
    sigma = images.sigma[paper.images]
    centre = x[layout.poses[:, :3]] + paper.origin - images.centre[paper.images]
    turn = angles_of(rotations(layout, x, paper.order), paper.order) - images.angles[paper.images]
    turn = (turn + np.pi) % (2.0 * np.pi) - np.pi
    point = x[layout.points] + paper.origin - points.xyz[paper.points]
    found = [
        difference("projection centres", centre, sigma[:, :3], names, ELEMENTS[:3]),
        difference("orientation angles", turn, sigma[:, 3:], names, ELEMENTS[3:]),
        difference("object points", point, points.sigma[paper.points], block.points[paper.points], ("X", "Y", "Z")),
        *_shared_differences(adjusted, paper, x[layout.shared]),
    ]
    return tuple(d for d in found if d is not None)


def _entries(adjusted: AdjustedBlock, paper: PaperBlock) -> np.ndarray:
    """(s,) the peer's entry of every shared parameter of ours, −1 where it has none."""
    p, place = adjusted.parameters, paper.shared.place()
    keys = zip(p.names, p.groups, p.kinds, strict=True)
    found = [place.get((str(name), (OWNERS.get(str(kind), ""), str(group))), -1) for name, group, kind in keys]
    return np.array(found, dtype=np.int64)


def adjusted_entries(adjusted: AdjustedBlock, paper: PaperBlock) -> np.ndarray:
    """Our value of every shared entry of the peer: as adjusted, or as it is held."""
    values, entry = paper.shared.start.copy(), _entries(adjusted, paper)
    ours = np.flatnonzero((entry >= 0) & (adjusted.parameters.status != "removed"))
    values[entry[ours]] = adjusted.parameters.value[ours]
    return values


def _shared_differences(adjusted: AdjustedBlock, paper: PaperBlock, values: np.ndarray) -> list[Difference | None]:
    p, entry = adjusted.parameters, _entries(adjusted, paper)
    known = (entry >= 0) & paper.shared.free[np.maximum(entry, 0)] if len(paper.shared.free) else entry >= 0
    peer = np.full(len(p), np.nan)
    peer[known] = values[entry[known]]
    labels = np.array([f"{name} ({group})" for name, group in zip(p.names, p.groups, strict=True)], dtype=object)
    return [
        difference(title, (peer - p.value)[own, None], p.sigma[own, None], labels[own], ("",))
        for kind, title in KINDS.items()
        if len(own := np.flatnonzero(p.kinds == kind))
    ]
