"""What the user has to be told beside the numbers: why there is no result, and what to doubt in the one there is."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.datum import control_share, nothing_holds
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.unknowns import State
from aerotri.observations.names import partnerless_in_words
from aerotri.results.adjusted_block import Outcome
from aerotri.results.failure import AdjustmentFailedError
from aerotri.statistics.summarise import count_observations

RUNAWAY = 5.0
"""Factor by which a principal distance may change before the adjustment is taken for lost."""

LITTLE_CONTROL = 0.25
"""Share of the block's area that height control should span at least."""


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


def refuse_runaway(system: NormalSystem, solution: Solution) -> None:
    """A principal distance that ran away is no convergence, however small the residuals have become.

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
            f"the adjustment changed the principal distance from {base[worst]:g} to {found[worst]:.3g} mm: the chosen "
            "parameters cannot be told apart",
            solution.iterations,
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
