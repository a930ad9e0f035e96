"""Sets of additional parameters whose values change from strip to strip, or from group to group, in the choice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.shared_parameters import cameras_of_groups
from aerotri.results.parameter_comparison import SetOutcome
from aerotri.statistics.clusters import OF_ONE_EXPOSURE, cluster_schemes
from aerotri.strategies.object_change import far_moved
from aerotri.strategies.parameter_choice import distances
from aerotri.strategies.parameter_comparison import Candidate, SetComparer

FEWEST_GROUPS, MOST_COLUMNS = 4, 200
"""Groups from which a size of differences is estimated, and values of all groups at most [C]: of fewer than four groups
a size says nothing; with more values the estimate of their sizes takes longer than all other sets together."""
MOST_SETS = 2
"""Best sets that are tried with values that change, if they have few enough [C]."""


def names_of_strips(prepared: Prepared) -> np.ndarray | None:
    """(n,) names of the strips, found where the track turns if there are none; None where a photograph has no strip."""
    u = prepared.system.unknowns
    images = u.block.images
    if all(images.strip.astype(str).tolist()):
        return images.strip
    names = np.full(len(images), "", dtype=object)
    for clusters in cluster_schemes(u.block, u.images, prepared.state.centre):
        if clusters.scheme == "strip" and clusters.joined == len(clusters):
            names[u.images] = [f"strip {k + 1}" for k in clusters.label]
    return names if all(names.tolist()) else None


def moving_outcomes(
    comparer: SetComparer, prepared: Prepared, strips: np.ndarray | None, outcomes: Sequence[SetOutcome]
) -> list[SetOutcome]:
    """The best sets with values for every strip, or every group of a column, where these differ significantly.

    Differences that are independent are tried first, and where they are significant a drift from group to group.

    Parameters
    ----------
    strips : (n,) names of the strips. outcomes : of the sets with one value for all photographs.
    """
    block = prepared.system.unknowns.block
    settings = block.settings
    if settings.deviations.kind != "free" or settings.adjustment.parameter_groups not in ("camera", "block"):
        return []
    columns = _columns(prepared, strips)
    found: list[SetOutcome] = []
    for outcome in _best(comparer, outcomes):
        for column, count in columns.items():
            if outcome.count * count > MOST_COLUMNS:
                continue
            tried = comparer.outcome(Candidate(outcome.choice, column, "independent"))
            if not (tried.converged and tried.p < settings.adjustment.alpha):
                continue
            drifting = comparer.outcome(Candidate(outcome.choice, column, "walk"))
            walks = drifting.converged and drifting.p < settings.adjustment.alpha and drifting.ratio > tried.ratio
            found.append(drifting if walks else tried)
    return found


def _best(comparer: SetComparer, outcomes: Sequence[SetOutcome]) -> list[SetOutcome]:
    """Sets of parameters, a random field not among them, that predict best of those that do not bend the object."""
    far = far_moved([o for o in outcomes if o.converged])
    outcomes = [o for o in outcomes if o.name not in far]
    behind = distances(comparer.comparison(outcomes))
    known = [
        o for o in outcomes
        if o.count and not np.isfinite(o.length_mm) and o.name in behind and np.isfinite(behind[o.name].value)
    ]  # fmt: skip
    return sorted(known, key=lambda o: behind[o.name].value)[:MOST_SETS]


def _columns(prepared: Prepared, strips: np.ndarray | None) -> dict[str, int]:
    """Columns of images.csv by which parameters may change, and how many groups each has.

    Groups whose photographs have several cameras are none: these would share one set.
    """
    u = prepared.system.unknowns
    images = u.block.images
    values = {k: v for k, v in images.columns.items() if k not in OF_ONE_EXPOSURE}
    if strips is not None:
        values = {"strip": strips, **values}
    counts = {}
    for name, column in values.items():
        own = column[u.images].astype(str)
        count = len(set(own.tolist()))
        of_one_camera = max(cameras_of_groups(images.camera[u.images], own).values(), default=0) <= 1
        if of_one_camera and all(own.tolist()) and FEWEST_GROUPS <= count <= len(own) // 2:
            counts[name] = count
    return counts
