"""What a family of additional parameters is: its parameters by name, where they come from, and how they act.

One record for all families. A family is linear when its image error is linear in the parameters and a function of the
measured position alone: it then has `evaluate`. Brown's and the forward lens are not: they count from the principal
point, or act on the ideal direction, and stand inside the collinearity equations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import numpy as np

    from aerotri.functional_model.additional_parameters.sizes import Sizes
    from aerotri.functional_model.additional_parameters.terms import Terms
    from aerotri.observations import Camera

NO_UNIT = "–"
POWERS = ("", "", "²", "³", "⁴", "⁵", "⁶", "⁷")


def per_mm(power: int) -> str:
    """Unit of one over millimetres to a power: '1/mm²'; `NO_UNIT` for the power 0."""
    return f"1/mm{POWERS[power]}" if power else NO_UNIT


class Evaluate(Protocol):
    """Patterns at image points: `Terms` with a column for every item that acts."""

    def __call__(
        self, camera: Camera, x: np.ndarray, y: np.ndarray, partials: bool, items: tuple[str, ...]
    ) -> Terms: ...


class AtHeights(Protocol):
    """Pattern (n, 2) of the item that depends on heights, at image points (n,) mm.

    `flying` (n,) m is the flying height over the mean ground, `above` (n,) m the height of the point over it.
    """

    def __call__(
        self, camera: Camera, x: np.ndarray, y: np.ndarray, flying: np.ndarray, above: np.ndarray, /
    ) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class Family:
    """A family of additional parameters.

    Parameters
    ----------
    name : as in block.toml and in names such as 'bluh.1'.
    items : names of its parameters; of a family in sizes those of the default or the largest size.
    mark : 'P' printed in a source paper, 'L' literature, 'D' derived, 'C' choice. reference : the source.
    text : what a parameter is, in a few words. unit : its unit, `NO_UNIT` for none.
    evaluate : the patterns of a linear family; None for one of the interior orientation.
    camera_model : the camera model it belongs to, None for any.
    default_items : what 'all' means, where it is not `items`.
    marks : of items whose mark is not that of the family.
    sizes : where the family comes in sizes, as in legendre:4x4.
    check_items : refuses items that exclude each other.
    needs_height : items that depend on the heights of the points, one at most; as a pattern of the image, at the mean
        ground, they are 0. at_heights : their pattern.
    is_grid : its items are nodes of a grid, one set of which no single one can be left out.
    """

    name: str
    items: tuple[str, ...]
    mark: str
    reference: str
    text: Callable[[str], str]
    unit: Callable[[str], str]
    evaluate: Evaluate | None = None
    camera_model: str | None = None
    default_items: tuple[str, ...] = ()
    marks: Mapping[str, str] = field(default_factory=dict)
    sizes: Sizes | None = None
    check_items: Callable[[Sequence[str]], None] | None = None
    needs_height: tuple[str, ...] = ()
    at_heights: AtHeights | None = None
    is_grid: bool = False

    @property
    def is_linear(self) -> bool:
        """Whether the image error is linear in the parameters and a function of the measured position alone."""
        return self.evaluate is not None

    @property
    def all_items(self) -> tuple[str, ...]:
        """What 'all' means."""
        return self.default_items or self.items

    def mark_of(self, item: str) -> str:
        """Mark of one parameter."""
        return self.marks.get(item, self.mark)

    def fits(self, camera: Camera) -> bool:
        """Whether the family can be used with a camera."""
        return self.camera_model in (None, camera.model)

    def terms(
        self, camera: Camera, x: np.ndarray, y: np.ndarray, partials: bool = False, items: Sequence[str] | None = None
    ) -> Terms:
        """Patterns of a linear family at image points.

        Parameters
        ----------
        x, y : (n,) mm from the image centre, the measured position.
        partials : whether the derivatives are wanted.
        items : which items, all unless given.

        Returns
        -------
        Terms with a column for every item that acts at a point.

        Raises
        ------
        TypeError
            When the family is not linear.
        """
        if self.evaluate is None:
            raise TypeError(f"family '{self.name}' is no function of the measured position alone")
        return self.evaluate(camera, x, y, partials, self.items if items is None else tuple(items))


@dataclass(frozen=True, order=True)
class Parameter:
    """One additional parameter: its family and its item.

    Examples
    --------
    >>> Parameter.of("brown.K1")
    Parameter(family='brown', item='K1')
    >>> str(Parameter("bluh", "7"))
    'bluh.7'
    """

    family: str
    item: str

    @classmethod
    def of(cls, name: str) -> Parameter:
        """The parameter of a name such as 'bluh.1'; the family of a name without a point is ''."""
        family, point, item = str(name).partition(".")
        return cls(family, item) if point else cls("", family)

    def __str__(self) -> str:
        return f"{self.family}.{self.item}"
