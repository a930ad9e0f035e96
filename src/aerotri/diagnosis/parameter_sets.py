"""What a comparison of sets of additional parameters says of each, in words."""

from __future__ import annotations

import numpy as np

from aerotri.results.parameter_comparison import SetOutcome
from aerotri.strategies.parameter_choice import Gain

HELPS = 1.645
"""Standard errors beyond which a gain is taken for one (95 %, one-sided)."""


def verdict(outcome: SetOutcome, gain: Gain | None, behind: Gain | None) -> str:
    """Whether a set earns its parameters, and whether another does better, in a few words.

    Parameters
    ----------
    gain : on the best of the sets it contains. behind : how far it is behind the best of all.
    """
    if not outcome.converged:
        return outcome.status
    said = []
    if gain is not None and np.isfinite(gain.value):
        mostly = 2 * outcome.significant > outcome.count > 0
        if gain.value > HELPS * gain.error:
            said.append("helps")
        else:
            said.append(f"{'significant, but ' * mostly}no better than {gain.against}")
    if behind is not None and np.isfinite(behind.value):
        if behind.against == outcome.name:
            said.append("the best")
        elif behind.value < -HELPS * behind.error:
            said.append(f"worse than {behind.against}")
        else:
            said.append("as good as the best")
    return "; ".join(said) or "–"
