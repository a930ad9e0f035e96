"""The families by name, the choice of items of one family for one camera, and what there is to choose from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import (
    bluh,
    brown,
    chebyshev,
    collocation,
    dmc,
    ebner,
    fourier,
    grid,
    gruen,
    interior_change,
    legendre,
    lens,
    ultracam_d,
)
from aerotri.functional_model.additional_parameters.family import NO_UNIT, Family, Parameter
from aerotri.functional_model.additional_parameters.sizes import Sizes, size_of, size_text
from aerotri.functional_model.additional_parameters.terms import Terms, dense_terms
from aerotri.observations import Camera

FAMILIES: dict[str, Family] = {
    module.FAMILY.name: module.FAMILY
    for module in (
        bluh, ultracam_d, dmc, ebner, gruen, fourier, legendre, chebyshev, grid, collocation, brown, lens,
        interior_change,
    )
}  # fmt: skip
LINEAR_FAMILIES = {name: family for name, family in FAMILIES.items() if family.is_linear}
"""Families whose image error is linear in the parameters and a function of the measured position alone."""
INTERIOR_FAMILIES = {name: family for name, family in FAMILIES.items() if not family.is_linear}
"""Families bound to the interior orientation: they count from the principal point or act on the ideal direction."""


@dataclass(frozen=True)
class ParameterSet:
    """Some items of one linear family, for one camera.

    Parameters
    ----------
    family : a key of `LINEAR_FAMILIES`.
    items : the chosen items, in the family's order.
    camera : gives the format and the flight axis.
    """

    family: str
    items: tuple[str, ...]
    camera: Camera

    @property
    def names(self) -> tuple[str, ...]:
        """'bluh.1' and so on."""
        return tuple(f"{self.family}.{item}" for item in self.items)

    def terms(self, x: np.ndarray, y: np.ndarray, partials: bool = False) -> Terms:
        """Acting patterns at points; `index` counts within `items`, what belongs to items not chosen is zero."""
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        if not self.items:
            return dense_terms(x, y, 0, partials, lambda x, y, value, partial: None)
        return LINEAR_FAMILIES[self.family].terms(self.camera, x, y, partials, self.items)

    def basis(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2, p) image error per unit of each parameter, mm."""
        terms = self.terms(x, y)
        return self._scatter(terms.index, terms.value)

    def partials(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2, p, 2) derivative of `basis` by x and y."""
        terms = self.terms(x, y, partials=True)
        if terms.partial is None:
            raise TypeError(f"family '{self.family}' returned no partials")
        return self._scatter(terms.index, terms.partial)

    def _scatter(self, index: np.ndarray, source: np.ndarray) -> np.ndarray:
        """Acting columns (n, 2, k, …) at their places among all p of them."""
        (n, k), p = index.shape, len(self.items)
        if k == p and (index == np.arange(p)).all():
            return source
        dense = np.zeros((n, 2, p, *source.shape[3:]))
        rows = np.arange(n)
        for column in range(k):
            dense[rows, :, index[:, column]] += source[:, :, column]
        return dense


def parameter_set(family: str, items: Iterable[str], camera: Camera) -> ParameterSet:
    """A `ParameterSet`, checked.

    Raises
    ------
    InputError
        When the family belongs to another camera model, has no such item, or items exclude each other.
    """
    wanted = LINEAR_FAMILIES[family].camera_model
    if not LINEAR_FAMILIES[family].fits(camera):
        raise InputError(
            f"parameters '{family}' belong to camera model '{wanted}', camera '{camera.name}' is '{camera.model}'",
            f'set model = "{wanted}" or leave the family out',
        )
    return ParameterSet(family, checked_items(family, items), camera)


def parameter_sets(names: Iterable[str], camera: Camera) -> tuple[ParameterSet, ...]:
    """The linear sets that parameters such as 'bluh.1' belong to, as far as they are of this camera's model.

    Names of other families and of other camera models are left out.
    """
    items: dict[str, list[str]] = {}
    for name in names:
        parameter = Parameter.of(name)
        if parameter.family in LINEAR_FAMILIES and LINEAR_FAMILIES[parameter.family].fits(camera):
            items.setdefault(parameter.family, []).append(parameter.item)
    return tuple(parameter_set(family, items[family], camera) for family in LINEAR_FAMILIES if family in items)


def default_items(family: str) -> tuple[str, ...]:
    """What ``family:all`` means."""
    return FAMILIES[family].all_items


def sizes_of(family: str) -> Sizes | None:
    """The sizes in which a family comes; None for one with a fixed list of items."""
    return FAMILIES[family].sizes


def is_grid(family: str) -> bool:
    """Whether the items of a family are nodes of a grid: one set, of which no single one can be left out."""
    return family in FAMILIES and FAMILIES[family].is_grid


def unit_of(name: str) -> str:
    """Unit of an additional parameter by its name; '–' where it has none, or is none."""
    parameter = Parameter.of(name)
    return FAMILIES[parameter.family].unit(parameter.item) if parameter.family in FAMILIES else NO_UNIT


def is_item(family: str, item: str) -> bool:
    """Whether a linear or interior family has an item."""
    try:
        return item in _places(family, _size_in_name(family, item))
    except InputError:
        return False


def checked_items(family: str, items: Iterable[str]) -> tuple[str, ...]:
    """Items without repetition in the family's order.

    Raises
    ------
    InputError
        For an item that the family does not have, and for items that exclude each other.
    """
    checked, wanted = FAMILIES[family], dict.fromkeys(items)
    for item in wanted:
        if item not in _places(family, _size_in_name(family, item)):
            raise InputError(f"'{family}' has no parameter '{item}'", items_text(family))
    if wanted and checked.check_items is not None:
        checked.check_items(tuple(wanted))
    homes = dict.fromkeys(_size_in_name(family, item) for item in wanted)
    return tuple(item for home in homes for item in _places(family, home) if item in wanted)


def _size_in_name(family: str, item: str) -> tuple[int, int] | None:
    """The size that begins the name of an item of a grid; None for the items of other families."""
    return None if sizes_of(family) is None else size_of(item.partition("_")[0])


@lru_cache(maxsize=64)
def _places(family: str, size: tuple[int, int] | None) -> dict[str, int]:
    """Place of every item, by its name, in the family or among the items of a size."""
    sizes = sizes_of(family)
    own = FAMILIES[family]
    known = (*own.needs_height, *own.items) if size is None or sizes is None else sizes.items(size)
    return {item: place for place, item in enumerate(known)}


def items_text(family: str) -> str:
    """What a family has to offer, for messages."""
    known, sizes = (*FAMILIES[family].needs_height, *FAMILIES[family].items), sizes_of(family)
    if sizes is not None:
        return (
            f"it has sizes from {size_text(sizes.smallest)} to {size_text(sizes.largest)}, as in "
            f"{family}:{size_text(sizes.default)}, and items such as {known[0]}"
        )
    return f"it has {joined_items(known)}" if known[0].isdigit() else f"it has {', '.join(known)}"


def joined_items(items: Iterable[str]) -> str:
    """Items as a specification has them: '1-8+12', names joined by +."""
    runs: list[list[str]] = []
    for item in items:
        follows = bool(runs) and item.isdigit() and runs[-1][-1].isdigit() and int(item) == int(runs[-1][-1]) + 1
        if follows:
            runs[-1].append(item)
        else:
            runs.append([item])
    return "+".join(run[0] if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)
