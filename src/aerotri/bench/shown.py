"""What the pages show: a result, or a block without one, and where its points are expected."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.bench.equations import Equations
from aerotri.bench.prediction import Prediction
from aerotri.bench.rays import order_of_rays
from aerotri.bench.records import Records, read_records, records_of_block
from aerotri.bench.rough_prediction import RoughPrediction, rough_prediction
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block

RELOAD = "load the page again"


@dataclass(frozen=True, eq=False)
class Shown:
    """A result, or a block alone.

    Parameters
    ----------
    result : its folder, None for a block alone. records : its tables.
    order : rows of the rays, the largest |w| first. equations : they are set up again beside the page.
    rough : where points appear by what is given, before the first adjustment.
    """

    result: Path | None
    records: Records
    order: np.ndarray
    equations: Equations
    rough: RoughPrediction | None

    def image(self, row: int) -> str:
        """The name of a photograph."""
        return str(self.records.block.images.names[row])

    def image_row(self, number: int) -> int:
        """A row of the photographs.

        Raises
        ------
        InputError
            When there is none of that number.
        """
        return row_of(number, len(self.records.block.images), "photograph")

    def point_row(self, number: int) -> int:
        """A row of the points.

        Raises
        ------
        InputError
            When there is none of that number.
        """
        return row_of(number, len(self.records.block.points), "point")

    def prediction(self) -> Prediction | RoughPrediction | None:
        """Where points appear: by the adjustment, before the first one by what is given; None where neither is."""
        return self.equations.prediction() or self.rough

    def xyz(self, point: str) -> np.ndarray | None:
        """(3,) m of a point, as it is adjusted, or given; None where neither."""
        r = self.records
        rows = np.flatnonzero(r.block.points == point)
        if not len(rows):
            return None
        given = np.flatnonzero(r.block.control.point == rows[0])
        if not np.isfinite(r.xyz[rows[0]]).all() and len(given):
            return r.block.control.xyz[given[0]]
        return r.xyz[rows[0]]

    def expected(self, point: int) -> list[Any]:
        """Photograph, column and row of everywhere that a point should appear."""
        prediction, xyz = self.prediction(), self.xyz(str(self.records.block.points[point]))
        if prediction is None or xyz is None or not np.isfinite(xyz).all():
            return []
        return [
            [image, *np.round(prediction.pixels(image, xyz[None])[0], 3).tolist()]
            for image in prediction.images_of(xyz).tolist()
        ]

    def expected_control(self, image: int) -> list[Any]:
        """Point, column and row of the control points that should appear in a photograph."""
        prediction, block = self.prediction(), self.records.block
        control = block.control.point
        if prediction is None or not len(control):
            return []
        xyz = np.where(np.isnan(self.records.xyz[control]), block.control.xyz, self.records.xyz[control])
        px = prediction.pixels(image, xyz)
        return [[int(p), *np.round(at, 3).tolist()] for p, at in zip(control, px, strict=True) if np.isfinite(at).all()]


def shown_of(block: Path, result: Path | None) -> Shown:
    """Read what is to be shown.

    Parameters
    ----------
    block : folder, read where there is no result.

    Raises
    ------
    InputError
        When the result or the block is damaged.
    """
    records = records_of_block(read_block(block)) if result is None else read_records(result)
    rough = rough_prediction(records.block) if result is None else None
    return Shown(result, records, order_of_rays(records), Equations(result), rough)


def row_of(number: int, count: int, what: str) -> int:
    """The number, where there is such a row.

    Parameters
    ----------
    what : photograph, point or layer.

    Raises
    ------
    InputError
        When there is none.
    """
    if not 0 <= number < count:
        raise InputError(f"there is no {what} {number}", RELOAD)
    return number
