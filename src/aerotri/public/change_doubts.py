"""What makes ground that is stated to be stable doubtful."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from aerotri.volume.boundary import Boundary
    from aerotri.volume.change.alignment import Alignment

LARGEST_FACTOR = 2.0
"""Of the noise on stable ground over the stated σ, from which on it is told; chosen [C]: σ of surfaces is seldom wrong
by so much."""
LARGEST_LIFT_M = 1.0
"""By which the second surface may be moved in height without a word; chosen [C]: systems of heights differ by more."""
LEAST_SHARED = 0.01
"""Share of an area in which change is looked for that may be stable: edges drawn along one another."""


def doubts_of_stable_ground(found: Alignment, ground: Boundary, areas: Mapping[str, Boundary]) -> list[str]:
    """Sentences for the user.

    Parameters
    ----------
    areas : in which change is looked for, by their names; none where that is everywhere.
    """
    said = []
    if found.factor > LARGEST_FACTOR:
        said.append(
            f"on the stable ground the surfaces differ by {found.factor:.3g} times what their σ says: it may have "
            "changed, or σ is too small; look at the map of the change there"
        )
    for name, area in areas.items():
        shared = area.polygon.intersection(ground.polygon).area / max(area.area, 1e-12)
        if shared > LEAST_SHARED:
            said.append(
                f"{100.0 * shared:.0f} % of {name} are stable ground: what changes there is taken for noise or moved "
                "away; leave it out of the stable ground"
            )
    lift = dict(zip(found.names, found.values.tolist(), strict=True)).get("dZ", 0.0)
    if abs(lift) > LARGEST_LIFT_M:
        said.append(
            f"the second surface lies {abs(lift):.2f} m {'higher' if lift > 0.0 else 'lower'} than the first on the "
            f"stable ground and was {'lowered' if lift > 0.0 else 'raised'} by that: check that both have heights of "
            "one system (above the ellipsoid or above sea level)"
        )
    return said
