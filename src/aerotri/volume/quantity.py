"""A volume as a record: cut, fill, net, areas, and what is not known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.conventions import in_digits


@dataclass(frozen=True)
class Volume:
    """A volume by one method; cut lies above the base, fill below it.

    Parameters
    ----------
    method : its name. note : what the user should know of it.
    cut, fill : m³, both positive. cut_area, fill_area : m². no_data_area : m² inside the boundary where the surface or
        the base is not known; it is in no volume.
    """

    method: str
    cut: float
    fill: float
    cut_area: float
    fill_area: float
    no_data_area: float
    note: str = ""

    @property
    def net(self) -> float:
        """m³, cut − fill."""
        return self.cut - self.fill

    @property
    def area(self) -> float:
        """m², what the volume is of."""
        return self.cut_area + self.fill_area

    @classmethod
    def of_sums(cls, method: str, sums: np.ndarray, note: str = "") -> Volume:
        """From (cut, fill, cut area, fill area, area not known)."""
        cut, fill, cut_area, fill_area, unknown = sums.tolist()
        return cls(method, cut, fill, cut_area, fill_area, unknown, note)


def no_data_note(volume: Volume) -> str:
    """A sentence about the area not known; '' when there is none."""
    whole = volume.area + volume.no_data_area
    if volume.no_data_area <= 1e-9 * whole:
        return ""
    area, part = in_digits(volume.no_data_area, 6), in_digits(100.0 * volume.no_data_area / whole, 2)
    return f"{area} m² ({part} %) inside the boundary have no height and are in no volume"
