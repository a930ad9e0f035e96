"""What an adjustment found of parameters that differ from group to group."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class FoundDeviation:
    """How much one parameter differs between the groups.

    Parameters
    ----------
    name : of the parameter. groups : how many have a value.
    sigma_um : σ of the values about their mean, or of the steps, as image error over the format; 0 where none is seen.
    sigma : the same in the unit of the parameter.
    ratio : −2·ln of the likelihood ratio against no deviation of this parameter.
    """

    name: str
    groups: int
    sigma_um: float
    sigma: float
    ratio: float


@dataclass(frozen=True)
class Deviations:
    """The deviations of all parameters, and whether they are needed.

    Parameters
    ----------
    kind : 'independent' or 'walk'.
    found : every parameter.
    total_um : root of the sum of squares of all sizes.
    ratio : −2·ln of the restricted likelihood ratio against one set of values for all photographs.
    p : probability of what was found where there are no deviations. needed : whether it is below the level of the test.
    """

    kind: str
    found: tuple[FoundDeviation, ...]
    total_um: float
    ratio: float
    p: float
    needed: bool

    def as_dict(self) -> dict[str, Any]:
        """As adjustment.json has it."""
        return {
            "kind": self.kind,
            "total_um": self.total_um,
            "ratio": self.ratio,
            "p": self.p,
            "needed": self.needed,
            "parameters": [
                {
                    "name": one.name,
                    "groups": one.groups,
                    "sigma_um": one.sigma_um,
                    "sigma": one.sigma,
                    "ratio": one.ratio,
                }
                for one in self.found
            ],
        }

    @property
    def sentence(self) -> str:
        """What a user is told."""
        if not self.needed:
            return f"the parameters of the groups do not differ (p {self.p:.2g}): one set serves all photographs"
        largest = sorted(self.found, key=lambda one: -one.sigma_um)[:3]
        names = ", ".join(f"{one.name} {one.sigma_um:.2g} µm" for one in largest if one.sigma_um > 0.0)
        how = "drift from group to group" if self.kind == "walk" else "differ between the groups"
        return f"the image errors {how} by {self.total_um:.2g} µm (p {self.p:.1g}), most in {names}"
