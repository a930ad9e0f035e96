"""Areas of a change: what of them is not known, measured against the whole polygon."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from aerotri.conventions import InputError, in_digits
from aerotri.public.change_epochs import Epochs, names_of

if TYPE_CHECKING:
    from aerotri.volume.boundary import Boundary
    from aerotri.volume.change.compute import Change

LEAST_UNKNOWN = 1e-6
"""Share of an area below which nothing is missing: rounding of corners and of cells."""


def with_whole_areas(found: Change, areas: Mapping[str, Boundary]) -> Change:
    """The change with areas without heights that count what of a polygon lies outside of the surfaces too."""
    volumes = []
    for one, boundary in zip(found.volumes, areas.values(), strict=True):
        missing = boundary.area - one.area
        volumes.append(replace(one, no_data_area=missing if missing > LEAST_UNKNOWN * boundary.area else 0.0))
    return replace(found, volumes=tuple(volumes))


def refuse_unknown_areas(found: Change, epochs: Epochs, whole: str) -> None:
    """Refuse a change of which nothing is known in an area.

    Parameters
    ----------
    whole : name of all that both surfaces have in common.

    Raises
    ------
    InputError
    """
    for one in found.volumes:
        if not one.area > 0.0:
            names = "the surfaces {} and {}".format(*names_of(epochs))
            if one.name == whole:
                raise InputError(f"{names} have no height with σ in common", "check the CRS of both")
            raise InputError(
                f"'{one.name}': {names} have no height with σ in common there",
                "draw the area inside both surfaces, in their CRS, or leave it out",
            )


def notes_of_areas(found: Change, whole: str) -> list[str]:
    """A sentence for every area that is not known as a whole.

    Parameters
    ----------
    whole : name of all that both surfaces have in common, which has holes and edges of its own.
    """
    named = found.volumes[:-1] if len(found.volumes) > 1 else found.volumes
    return [
        f"{one.name}: {in_digits(one.no_data_area, 6)} m² "
        f"({in_digits(100.0 * one.no_data_area / (one.area + one.no_data_area), 2)} %) of the area have no height in "
        "both surfaces and are in no volume"
        for one in named
        if one.name != whole and one.no_data_area > 0.0
    ]
