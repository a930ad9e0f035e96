"""What the user has to be told beside the numbers: why there is no result, and what to doubt in the one there is."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.datum import control_share, nothing_holds
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.ray_status import RayStatus
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.unknowns import State
from aerotri.diagnosis.finding import SIGNIFICANCE, times
from aerotri.observations.names import partnerless_in_words
from aerotri.quantiles import chi_square_quantile
from aerotri.results.adjusted_block import AdjustedBlock, Outcome
from aerotri.results.failure import AdjustmentFailedError
from aerotri.statistics.summarise import count_observations

RUNAWAY = 5.0
"""Factor by which a principal distance may change before the adjustment is taken for lost."""

MISSED_START = 0.1
"""Share of half the diagonal of a photograph by which start values miss the image points (median) that are wrong [C]:
navigation and strips along a track miss by a few hundredths."""

LITTLE_CONTROL = 0.25
"""Share of the block's area that height control should span at least."""

NO_RESIDUALS_PX = 1e-3
"""RMS of image residuals, in pixels, below which they are none [C]: the best targets are measured to some hundredths of
a pixel."""

TOO_GOOD = 0.2
"""σ̂0 below which the stated σ are far too large [C]: a σ is seldom known better than by a factor of two."""


def failure(system: NormalSystem, status: str, message: str, iterations: int = 0) -> AdjustmentFailedError:
    """The error of an adjustment without result."""
    counts = count_observations(system)
    return AdjustmentFailedError(
        Outcome(
            status=status,
            message=message,
            iterations=iterations,
            sigma0=np.nan,
            sigma0_um=np.nan,
            vtpv=np.nan,
            observations=counts.observations,
            unknowns=counts.unknowns,
            conditions=counts.conditions,
            redundancy=counts.redundancy,
            verdict="rejected",
            reasons=(message,),
        )
    )


def defects_in_words(system: NormalSystem, defects: list[str] | tuple[str, ...]) -> str:
    """The rank defects with their cause and remedy."""
    text, block = "; ".join(defects), system.unknowns.block
    if block.settings.adjustment.datum != "control" or "datum" not in text:
        return text
    lonely = "".join(f". {sentence}" for sentence in partnerless_in_words(block))
    if nothing_holds(system.unknowns, system.extras):
        return f'no control: {text}. Give control points, or set datum = "minimal" or "inner"{lonely}'
    return f"too little control: {text}{lonely}"


def refuse_runaway(system: NormalSystem, solution: Solution, start: State) -> None:
    """A principal distance that ran away is no convergence, however small the residuals have become.

    Parameters
    ----------
    start : where the adjustment began: image points that were missed by far there say why.

    Raises
    ------
    AdjustmentFailedError
    """
    base = system.unknowns.lens.base[:, 0]
    found = system.unknowns.interior(solution.state)[:, 0]
    change = np.abs(np.log(np.maximum(found / base, 1e-12)))
    if (change > np.log(RUNAWAY)).any():
        worst = int(np.argmax(change))
        raise failure(
            system,
            "not converged",
            f"the adjustment changed the principal distance from {base[worst]:g} to {found[worst]:.3g} mm: "
            + (_wrong_start_in_words(system, start) or "the chosen parameters cannot be told apart"),
            solution.iterations,
        )


def _wrong_start_in_words(system: NormalSystem, start: State) -> str:
    """That the start values miss the image points by far; '' where they do not."""
    u = system.unknowns
    block, rays = u.block, u.rays
    missed = np.linalg.norm(system.right_side(start, LEAST_SQUARES).residual, axis=1)
    of_ray = block.images.camera[u.images[rays.image]]
    format_mm, pixel = np.array([(camera.r_max_mm, camera.pixel_mm) for camera in block.cameras])[of_ray].T
    if not np.median(missed / format_mm) > MISSED_START:
        return ""
    return (
        f"the start values do not fit: they miss the image points by {np.median(missed / pixel):.3g} px "
        "(median). Check the orientations, their angles and axes, and the axes of the image points"
    )


def doubts(system: NormalSystem, state: State) -> tuple[str, ...]:
    """Sentences about what the block itself leaves doubtful."""
    block, said = system.unknowns.block, []
    if block.settings.adjustment.datum == "control" and not system.observes_centres:
        share = control_share(system.unknowns, state)
        if share < LITTLE_CONTROL:
            said.append(
                f"the height control spans {100.0 * share:.0f} % of the block's area: beyond it heights are "
                "extrapolated, see their σ"
            )
    redundancy = count_observations(system).redundancy
    if redundancy <= 0:
        said.append(f"redundancy {redundancy}: nothing controls the observations, σ is not known")
    return tuple(said)


def too_good_in_words(result: AdjustedBlock) -> tuple[str, ...]:
    """A sentence where the residuals are none, or far smaller than the stated σ."""
    o, rays, block = result.outcome, result.rays, result.block
    if o.status != "converged" or not o.sigma0 < TOO_GOOD or o.redundancy <= 0:
        return ()
    if o.sigma0**2 * o.redundancy >= chi_square_quantile(SIGNIFICANCE, o.redundancy):
        # so few observations may fit as well by chance
        return ()
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[block.image_points.image]]
    used = rays.status == RayStatus.USED
    rms = float(np.sqrt(np.mean(np.square(rays.v[used] / pixel[used, None]))))
    if rms < NO_RESIDUALS_PX:
        return (
            f"there are no residuals: the image points fit to {rms:.1e} px (RMS), as no measured ones do. They were "
            "computed, not measured; σ0 and all σ that follow from it say nothing about real measurements",
        )
    return (
        f"σ0 is {o.sigma0:.2g}: the residuals are {times(1.0 / o.sigma0)} smaller than the stated σ, which are far too "
        "large. State the σ that the measurements really have: they decide how much control, positions and image "
        "points count against one another",
    )
