"""Is the error in the tie points or in the control? The block adjusted free first, then with what holds it.

The free block (minimal datum, no observed positions) shows how the tie points fit one another. What holds the block
adds redundancy Δr and vᵀPv: if it fits, Δ(vᵀPv)/Δr over σ̂0² of the free block follows Fisher's F with Δr and r_free
degrees of freedom [L: test of nested linear models], whatever the unknowns, self-calibration among them, are. Control
counts with its σ as given, in metres, whether or not the a-priori σ of the image points is right: in the test its
weights are multiplied by σ̂0² of the free block.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.special import fdtri

from aerotri.conventions import InputError
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.failure import AdjustmentFailedError
from aerotri.statistics.outliers import RayTests, judge_rays, sure_value
from aerotri.statistics.reliability import critical_value
from aerotri.statistics.similarity import Similarity, fit_similarity
from aerotri.strategies.free_stages import CONTROL, FREE, POSITIONS, FreeCheck, Stage, Suspect

__all__ = ["FreeCheck", "check_free", "free_block"]

SAME_SCALE = 0.01
"""σ̂0 of the free block nearer to 1 than this needs no adjustment with other weights."""
NAMED_SUSPECTS = 10
"""Suspects named at a stage, the largest first [C]: one or two explain most mistakes, ten still fit on a screen."""
LEAST_SIGMA_M = 1e-6
"""Stands for σ = 0 of control in the weights of a similarity."""

Adjust = Callable[[Block], AdjustedBlock]


def check_free(block: Block, adjust: Adjust, full: AdjustedBlock | None = None) -> FreeCheck:
    """Adjust a block free, then with control, then with observed positions, and say which of them does not fit.

    Parameters
    ----------
    block : in local coordinates, with datum = "control". adjust : what adjusts a block (`aerotri.pipeline.adjust`).
    full : the adjustment of `block` where it is known already.
    """
    sigma0_full = np.nan if full is None else full.outcome.sigma0
    block, changed = _comparable(block, full)
    full = None if changed else full
    robust = block.settings.adjustment.robust != "off"
    try:
        judged = free = adjust(free_block(block))
        if robust:
            block, full = _with_frozen_weights(block, judged), None
            free = adjust(free_block(block))
    except (AdjustmentFailedError, InputError) as failure:
        stage = _failed(FREE, failure)
        nothing = np.zeros(0, dtype=str)
        return FreeCheck((stage,), sigma0_full, np.nan, 0, nothing, None, None, robust)
    o = free.outcome
    tests = judge_rays(judged)
    first = Stage(FREE, o.status, o.message, o.sigma0, o.vtpv, o.redundancy, suspects=_ray_suspects(judged, tests))
    added, by_control = _stages(block, adjust, free, full)
    return FreeCheck(
        stages=(first, *added),
        sigma0_full=sigma0_full,
        spread=tests.scale,
        beyond=int((np.abs(np.nan_to_num(tests.w)) > tests.sure).sum()),
        point=free.block.points[free.control.point].astype(str),
        similarity=_similarity(free),
        position_offset=_position_offset(block, by_control),
        robust=robust,
    )


def _comparable(block: Block, full: AdjustedBlock | None) -> tuple[Block, bool]:
    """The block with the same observations, weights and unknowns in every stage, and whether that changed a setting.

    All stages start from the orientation of the full adjustment where there is one.
    """
    given = block.settings.adjustment
    robust = given.robust if given.robust == "off" else "huber"
    settings = replace(given, robust=robust, variance_components="off", parameter_selection="off")
    if full is not None:
        centre, angles = block.images.centre.copy(), block.images.angles.copy()
        found = np.isfinite(full.images.centre).all(axis=1)
        centre[found], angles[found] = full.images.centre[found], full.images.angles[found]
        block = replace(block, images=replace(block.images, centre=centre, angles=angles))
    return replace(block, settings=replace(block.settings, adjustment=settings)), settings != given


def _with_frozen_weights(block: Block, free: AdjustedBlock) -> Block:
    """The block with the robust weights of the free adjustment as weights a priori, for least squares.

    Weights that every stage finds anew would change vᵀPv as much as what is tested does.
    """
    rays, weight = block.image_points, np.nan_to_num(free.rays.weight)
    factor = np.where(weight > 0.0, np.sqrt(np.where(weight > 0.0, weight, 1.0)), 1.0)
    settings = replace(block.settings, adjustment=replace(block.settings.adjustment, robust="off"))
    return replace(block, image_points=replace(rays, sigma=rays.sigma / factor[:, None]), settings=settings)


def free_block(block: Block) -> Block:
    """The block held by nothing but a minimal datum; observed positions remain as start values."""
    images = block.images
    if block.gnss_ins is not None:
        centre, rows = images.centre.copy(), block.gnss_ins.image
        centre[rows] = np.where(np.isfinite(centre[rows]), centre[rows], block.gnss_ins.xyz)
        images = replace(images, centre=centre)
    adjustment = replace(block.settings.adjustment, datum="minimal", datum_points=(), datum_fixed=())
    settings = replace(block.settings, adjustment=adjustment)
    return replace(block, images=images, gnss_ins=None, constraints=None, settings=settings)


def _stages(
    block: Block, adjust: Adjust, free: AdjustedBlock, full: AdjustedBlock | None
) -> tuple[list[Stage], AdjustedBlock | None]:
    """The adjustments after the free one with their tests, and the result of the one with control alone, or None."""
    scale = free.outcome.sigma0 if free.outcome.redundancy > 0 else 1.0
    if abs(scale - 1.0) < SAME_SCALE:
        scale = 1.0
    weighted = _as_stated(block, scale)
    todo = [(CONTROL, replace(weighted, gnss_ins=None))]
    if block.gnss_ins is not None:
        todo.append((POSITIONS, weighted))
    stages, by_control, before = [], None, free
    for name, chosen in todo:
        same = scale == 1.0 and full is not None and name == todo[-1][0]
        try:
            after = full if same and full is not None else adjust(chosen)
        except (AdjustmentFailedError, InputError) as failure:
            if name == todo[-1][0]:
                stages.append(_failed(name, failure))
            continue
        stages.append(_tested(name, before, after, free))
        by_control, before = (after if name == CONTROL else by_control), after
    return stages, by_control


def _as_stated(block: Block, scale: float) -> Block:
    """The block with σ of all but the image points divided by `scale`, so that σ̂0 = scale brings them back."""
    if scale == 1.0:
        return block
    control = replace(block.control, sigma=block.control.sigma / scale)
    gnss_ins, constraints = block.gnss_ins, block.constraints
    if gnss_ins is not None:
        gnss_ins = replace(gnss_ins, sigma=gnss_ins.sigma / scale, angles_sigma=gnss_ins.angles_sigma / scale)
    if constraints is not None:
        constraints = replace(constraints, sigma=constraints.sigma / scale)
    return replace(block, control=control, gnss_ins=gnss_ins, constraints=constraints)


def _tested(name: str, before: AdjustedBlock, after: AdjustedBlock, free: AdjustedBlock) -> Stage:
    """The stage `after`, tested against the one before with σ̂0² of the free block."""
    o, alpha = after.outcome, after.block.settings.adjustment.alpha
    freedom, added = free.outcome.redundancy, o.redundancy - before.outcome.redundancy
    ratio = limit = np.nan
    if added > 0 and freedom > 0:
        variance = free.outcome.vtpv / freedom
        ratio = max(o.vtpv - before.outcome.vtpv, 0.0) / added / variance
        limit = float(fdtri(added, freedom, 1.0 - alpha))
    values = sorted(_added_values(after, free.outcome.sigma0), key=lambda value: -abs(value.w))
    w_limit = sure_value(alpha, len(values))
    large = tuple(value for value in values if abs(value.w) > critical_value(alpha))
    return Stage(
        name=name,
        status=o.status,
        message=o.message,
        sigma0=o.sigma0,
        vtpv=o.vtpv,
        redundancy=o.redundancy,
        added=o.observations - before.outcome.observations,
        ratio=ratio,
        limit=limit,
        largest_w=abs(values[0].w) if values else np.nan,
        w_limit=w_limit,
        suspects=large[:NAMED_SUSPECTS],
    )


def _failed(name: str, failure: AdjustmentFailedError | InputError) -> Stage:
    if isinstance(failure, InputError):
        return Stage(name, "not adjusted", str(failure), np.nan, np.nan, 0)
    o = failure.outcome
    return Stage(name, o.status, o.message, np.nan, np.nan, o.redundancy)


def _added_values(after: AdjustedBlock, sigma0: float) -> list[Suspect]:
    """Control coordinates, observed positions and conditions with their w, in units of σ̂0 of the free block."""
    values = []
    names, control = after.block.points, after.control
    with np.errstate(divide="ignore", invalid="ignore"):
        error = -control.difference / control.r
    for row, point in enumerate(control.point):
        for k, axis in enumerate("XYZ"):
            if np.isfinite(control.w[row, k]):
                w = float(control.w[row, k]) / sigma0
                values.append(Suspect("control", str(names[point]), axis, w, float(error[row, k])))
    observed = after.observations
    if observed is not None:
        for k in np.flatnonzero(np.isfinite(observed.w)):
            w, gap = float(observed.w[k]) / sigma0, float(-observed.v[k] / observed.r[k])
            values.append(Suspect(str(observed.group[k]), str(observed.label[k]), str(observed.component[k]), w, gap))
    return values


def _ray_suspects(free: AdjustedBlock, tests: RayTests) -> tuple[Suspect, ...]:
    block, found = free.block, []
    for row in tests.order[:NAMED_SUSPECTS]:
        if abs(tests.w[row]) > tests.sure:
            point = block.points[block.image_points.point[row]]
            name = f"{point} in {block.images.names[block.image_points.image[row]]}"
            error, pixels = float(tests.estimated_mm[row]), float(tests.estimated_px[row])
            found.append(Suspect("ray", name, "xy"[tests.axis[row]], float(tests.w[row]), error, pixels))
    return tuple(found)


def _similarity(free: AdjustedBlock) -> Similarity | None:
    control = free.control
    if not len(control):
        return None
    row_of = {int(point): row for row, point in enumerate(free.block.control.point)}
    sigma = np.maximum(free.block.control.sigma[[row_of[int(point)] for point in control.point]], LEAST_SIGMA_M)
    adjusted = free.points.xyz[control.point]
    return fit_similarity(adjusted, adjusted - control.difference, sigma)


def _position_offset(block: Block, by_control: AdjustedBlock | None) -> np.ndarray | None:
    """(3,) m, mean of observed antennas less the antennas where control alone puts the photographs."""
    if block.gnss_ins is None or by_control is None:
        return None
    rows = block.gnss_ins.image
    turn = rotation_from_angles(by_control.images.angles[rows], block.rotation)
    antenna = by_control.images.centre[rows] + turn @ np.array(block.settings.gnss.lever_arm_m)
    gap = block.gnss_ins.xyz - antenna
    known = np.isfinite(gap)
    if not known.any(axis=0).all():
        return None
    return np.where(known, gap, 0.0).sum(axis=0) / known.sum(axis=0)
