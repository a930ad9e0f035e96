"""Systematic image errors as a notebook sees them: of a result, of a simulated flight, and their difference."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import InputError
from aerotri.public.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.image_errors import AveragedResiduals, ErrorField, ImageGroup
    from aerotri.observations import Block
    from aerotri.results.adjusted_block import AdjustedBlock

MOST_BESIDE = 4
"""Fields that are drawn beside each other at most; chosen [C]: more are too small on a page."""


@dataclass(frozen=True, eq=False, repr=False)
class ImageErrors:
    """Systematic image errors, measured − ideal, on a grid over the format of a camera.

    Parameters
    ----------
    name : heading of a plot.
    field : the errors as arrays, mm.

    Examples
    --------
    >>> import aerotri
    >>> flight = aerotri.simulate(aerotri.example_flight(), seed=1)
    >>> found = aerotri.adjust(flight.block, parameters="brown:K1+K2").image_errors()
    >>> left = found - flight.true_image_errors()
    >>> left.table.columns
    ('x', 'y', 'dx', 'dy', 's_dx', 's_dy', 'significant')
    """

    name: str
    field: ErrorField

    @property
    def rms_um(self) -> float:
        """µm, root mean square length of the vectors."""
        return 1e3 * self.field.rms

    @property
    def largest_um(self) -> float:
        """µm, the longest vector."""
        return 1e3 * self.field.max

    @property
    def sigma_um(self) -> float:
        """µm, root mean square length that the vectors would have by their σ alone; 0 for the truth."""
        return 1e3 * float(np.sqrt(np.mean(np.sum(self.field.sigma**2, axis=-1))))

    @cached_property
    def table(self) -> Table:
        """A row a node: place in the image in mm, error and its σ in µm, and whether it is significant at 95 %."""
        f = self.field
        d, sigma = 1e3 * f.d.reshape(-1, 2), 1e3 * f.sigma.reshape(-1, 2)
        columns = {
            "x": f.x.ravel(), "y": f.y.ravel(), "dx": d[:, 0], "dy": d[:, 1], "s_dx": sigma[:, 0],
            "s_dy": sigma[:, 1], "significant": f.significant.ravel(),
        }  # fmt: skip
        units: dict[str, str] = {**dict.fromkeys(("x", "y"), "mm"), **dict.fromkeys(("dx", "dy", "s_dx", "s_dy"), "µm")}
        return Table.of("image errors", columns, units)

    def __sub__(self, other: ImageErrors) -> ImageErrors:
        """The difference; σ as of independent errors, significant where it is beyond them at 95 %.

        Raises
        ------
        InputError
            When the two are not of one format and grid.
        """
        from aerotri.image_errors import field_between

        self._refuse_other_grid(other)
        return ImageErrors(f"{self.name} − {other.name}", field_between(self.field, other.field))

    def plot(self, *others: ImageErrors, title: str = "Systematic image errors") -> Figure:
        """The errors as vectors; others beside them on the same scale.

        Parameters
        ----------
        others : of the same format, three at most. title : over all of them.

        Raises
        ------
        InputError
            For more than four in all, or another format.
        """
        from aerotri.report.plots.panels import Panel, plot_panels

        if len(others) >= MOST_BESIDE:
            raise InputError(f"{len(others) + 1} fields are too many for one plot", f"draw {MOST_BESIDE} at most")
        for other in others:
            self._refuse_other_format(other)
        return plot_panels([Panel(one.name, one.field) for one in (self, *others)], title)

    def named(self, name: str) -> ImageErrors:
        """The same errors under another heading."""
        return ImageErrors(name, self.field)

    def _refuse_other_grid(self, other: ImageErrors) -> None:
        self._refuse_other_format(other)
        if self.field.x.shape != other.field.x.shape:
            raise InputError("the errors are given at other places", "give both the same number of nodes")

    def _refuse_other_format(self, other: ImageErrors) -> None:
        if self.field.camera.half_format_mm != other.field.camera.half_format_mm:
            raise InputError(f"'{other.name}' is of another format than '{self.name}'", "take cameras of one format")

    def __repr__(self) -> str:
        return f"<aerotri.ImageErrors {self.name!r}: RMS {self.rms_um:.2f} µm, largest {self.largest_um:.2f} µm>"

    def _repr_html_(self) -> str:
        sigma = f", expected from σ alone {self.sigma_um:.2f} µm" if self.sigma_um else ""
        return f"<p><b>{escape(self.name)}</b>: RMS {self.rms_um:.2f} µm, largest {self.largest_um:.2f} µm{sigma}</p>"


def errors_of_result(
    adjusted: AdjustedBlock, group: str | None, camera: str | None, without_orientation: bool, nodes: int | None
) -> ImageErrors:
    """As `Adjustment.image_errors`.

    Raises
    ------
    InputError
        For a group that the block does not have.
    """
    from aerotri.image_errors import field_on_grid, field_without_orientation

    found = chosen_group(adjusted.block, group, camera)
    make = field_without_orientation if without_orientation else field_on_grid
    name = found.name if len(adjusted.block.cameras) == 1 else f"{found.name}, {found.camera.name}"
    return ImageErrors(name, make(adjusted, found.name, nodes, found.camera.name))


def errors_at(adjusted: AdjustedBlock, xy: np.ndarray, group: str | None, camera: str | None) -> np.ndarray:
    """As `Adjustment.image_errors_at`."""
    from aerotri.image_errors import systematic_errors

    found, at = chosen_group(adjusted.block, group, camera), np.asarray(xy, dtype=float)
    return systematic_errors(adjusted, found.name, at[:, 0], at[:, 1], found.camera.name)[0]


def residuals_of_result(adjusted: AdjustedBlock, group: str | None, camera: str | None) -> AveragedResiduals:
    """As `Adjustment.averaged_residuals`."""
    from aerotri.image_errors import averaged_residuals

    found = chosen_group(adjusted.block, group, camera)
    return averaged_residuals(adjusted, found.name, camera=found.camera.name)


def chosen_group(block: Block, group: str | None, camera: str | None) -> ImageGroup:
    """The group of that name; the first where None.

    Raises
    ------
    InputError
        For a group that the block does not have, or one of several cameras where none is named.
    """
    from aerotri.image_errors import image_groups

    groups = image_groups(block)
    found = [one for one in groups if group in (None, one.name) and camera in (None, one.camera.name)]
    if not found or (group is not None and len(found) > 1):
        known = ", ".join(f"{one.name} ({one.camera.name})" for one in groups)
        problem = "belongs to several cameras" if found else "is not there"
        raise InputError(f"the group '{group or camera}' {problem}", f"groups and their cameras: {known}")
    return found[0]
