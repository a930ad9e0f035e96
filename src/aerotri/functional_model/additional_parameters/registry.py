"""The families by name, and the choice of items of one family for one camera."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import bluh, brown, lens, ultracam_d
from aerotri.functional_model.additional_parameters.terms import Terms
from aerotri.observations import Camera

LINEAR_FAMILIES: dict[str, ModuleType] = {m.FAMILY: m for m in (bluh, ultracam_d)}
"""Families whose image error is linear in the parameters and a function of the measured position alone."""

INTERIOR_FAMILIES: dict[str, ModuleType] = {m.FAMILY: m for m in (brown, lens)}
"""Families bound to the interior orientation: they count from the principal point or act on the ideal direction."""

FAMILIES: dict[str, ModuleType] = LINEAR_FAMILIES | INTERIOR_FAMILIES


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

    def terms(self, x: np.ndarray, y: np.ndarray) -> Terms:
        """Acting patterns at points; `index` counts within `items`, columns of items not chosen are zero."""
        module = LINEAR_FAMILIES[self.family]
        terms = module.terms(self.camera, np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        place = np.full(len(module.ITEMS), -1)
        place[[module.ITEMS.index(item) for item in self.items]] = np.arange(len(self.items))
        index = place[terms.index]
        keep = np.flatnonzero((index >= 0).any(axis=0)) if len(index) else np.arange(index.shape[1])
        index, value, partial = index[:, keep], terms.value[:, :, keep], terms.partial[:, :, keep]
        chosen = index >= 0
        return Terms(np.where(chosen, index, 0), value * chosen[:, None, :], partial * chosen[:, None, :, None])

    def basis(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2, p) image error per unit of each parameter, mm."""
        return self._scatter(self.terms(x, y), with_partials=False)

    def partials(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2, p, 2) derivative of `basis` by x and y."""
        return self._scatter(self.terms(x, y), with_partials=True)

    def _scatter(self, terms: Terms, with_partials: bool) -> np.ndarray:
        n, k = terms.index.shape
        source = terms.partial if with_partials else terms.value
        dense = np.zeros((n, 2, len(self.items), *source.shape[3:]))
        rows = np.arange(n)
        for column in range(k):
            dense[rows, :, terms.index[:, column]] += source[:, :, column]
        return dense


def parameter_set(family: str, items: Iterable[str], camera: Camera) -> ParameterSet:
    """A `ParameterSet`, checked.

    Raises
    ------
    InputError
        When the family belongs to another camera model.
    """
    module = LINEAR_FAMILIES[family]
    if module.CAMERA_MODEL not in (None, camera.model):
        raise InputError(
            f"parameters '{family}' belong to camera model '{module.CAMERA_MODEL}', camera '{camera.name}' is "
            f"'{camera.model}'",
            f'set model = "{module.CAMERA_MODEL}" or leave the family out',
        )
    wanted = set(items)
    return ParameterSet(family, tuple(item for item in module.ITEMS if item in wanted), camera)


def parse_parameters(spec: str | Iterable[str]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Families and items of a specification such as ``bluh:1-8+12,ultracam_d:42-73`` (or ``none``).

    Parameters
    ----------
    spec : the text of the command line, or the list of block.toml.

    Returns
    -------
    (family, items) pairs; items without repetition in the family's order.

    Raises
    ------
    InputError
        For an unknown family or item, naming those there are.
    """
    parts = spec.split(",") if isinstance(spec, str) else list(spec)
    parts = [part.strip() for part in parts if part.strip()]
    if parts == ["none"]:
        return ()
    chosen: dict[str, set[str]] = {}
    for part in parts:
        family, _, items = part.partition(":")
        if family not in FAMILIES:
            raise InputError(f"unknown parameter family '{family}'", f"known are {', '.join(FAMILIES)}, or none")
        chosen.setdefault(family, set()).update(_items(family, items or "all"))
    return tuple((family, tuple(i for i in FAMILIES[family].ITEMS if i in items)) for family, items in chosen.items())


def _items(family: str, text: str) -> list[str]:
    known = FAMILIES[family].ITEMS
    if text == "all":
        return list(known)
    items: list[str] = []
    for piece in text.split("+"):
        span = re.fullmatch(r"(\d+)-(\d+)", piece.strip())
        names = [str(i) for i in range(int(span[1]), int(span[2]) + 1)] if span else [piece.strip()]
        unknown = [name for name in names if name not in known]
        if unknown or not names:
            raise InputError(
                f"'{family}' has no parameter '{unknown[0] if unknown else piece}'",
                f"it has {known[0]} to {known[-1]}" if known[0].isdigit() else f"it has {', '.join(known)}",
            )
        items += names
    return items
