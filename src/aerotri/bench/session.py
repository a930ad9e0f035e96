"""One bench: the block and its result, what is looked at, and what goes on behind the page."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.bench.places import Places
from aerotri.bench.plan import plan_content
from aerotri.bench.rays import MOST_ROWS, chosen_rays, order_of_rays, point_content, ray_rows
from aerotri.bench.records import read_records, records_of_block
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.outliers import spread
from aerotri.statistics.reliability import critical_value


class Bench:
    """What the pages ask for; every method may be called from any thread.

    Parameters
    ----------
    places : the folders. photographs : the folder of the photographs, None where there are none.
    """

    def __init__(self, places: Places, photographs: Path | None = None):
        self.places, self._folder = places, photographs
        self._lock = threading.RLock()
        self.generation = 0
        self._show(places.result)

    def _show(self, result: Path | None) -> None:
        """Take up a result, or the block alone."""
        records = records_of_block(read_block(self.places.readable_block)) if result is None else read_records(result)
        with self._lock:
            self.result, self.records = result, records
            self.order = order_of_rays(records)
            self.generation += 1
            self._equations = _Equations(result)

    def summary(self) -> dict[str, Any]:
        """What the head of the page says."""
        r = self.records
        o = r.outcome
        return {
            "name": str(r.block.name), "result": "" if self.result is None else self.result.name,
            "status": o.get("status", "not adjusted"), "verdict": o.get("verdict", ""),
            "reasons": o.get("reasons", []), "sigma0": o.get("sigma0"), "sigma0_um": o.get("sigma0_um"),
            "limit": spread(r.w) * critical_value(r.block.settings.adjustment.alpha),
            "counts": r.block.counts, "crs": r.block.crs, "generation": self.generation,
            "cameras": [
                {"name": camera.name, "size": list(camera.size_px)} for camera in r.block.cameras
            ],
            "camera_of": r.block.images.camera.tolist(), "photographs": self._folder is not None,
        }  # fmt: skip

    def state(self) -> dict[str, Any]:
        """What goes on: asked for every second."""
        return {"generation": self.generation, "equations": self._equations.state()}

    def plan(self) -> dict[str, Any]:
        """See `plan_content`."""
        return plan_content(self.records)

    def rays(self, first: int, image: int | None, point: int | None, text: str) -> dict[str, Any]:
        """A page of the table of rays from row `first` on."""
        rows = chosen_rays(self.records, self.order, image, point, text)
        return {"count": len(rows), "first": first, "rows": ray_rows(self.records, rows[first : first + MOST_ROWS])}

    def point(self, point: int) -> dict[str, Any]:
        """See `point_content`.

        Raises
        ------
        InputError
        """
        return point_content(self.records, self._row(point, len(self.records.block.points), "point"))

    def photograph(self, image: int) -> dict[str, Any]:
        """The rays of a photograph.

        Raises
        ------
        InputError
        """
        row = self._row(image, len(self.records.block.images), "photograph")
        rows = np.flatnonzero(self.records.block.image_points.image == row)
        camera = self.records.block.cameras[self.records.block.images.camera[row]]
        name = str(self.records.block.images.names[row])
        return {"image": row, "name": name, "size": list(camera.size_px), "rays": ray_rows(self.records, rows)}

    def equations(self) -> Adjustment:
        """The adjustment with its equations.

        Raises
        ------
        InputError
            Where there is none, or none yet.
        """
        return self._equations.get()

    def _row(self, number: int, count: int, what: str) -> int:
        if not 0 <= number < count:
            raise InputError(f"there is no {what} {number}", "load the page again")
        return number


class _Equations:
    """The equations of a result, set up behind the page."""

    def __init__(self, result: Path | None):
        self._found: Adjustment | None = None
        self._error = "" if result is not None else "the block is not adjusted"
        if result is not None:
            threading.Thread(target=self._open, args=(result,), daemon=True).start()

    def _open(self, result: Path) -> None:
        from aerotri.opening import open_result

        try:
            self._found = open_result(result)
        except InputError as error:
            self._error = str(error)

    def state(self) -> str:
        """'ready', 'being set up', or why there are none."""
        return "ready" if self._found is not None else self._error or "being set up"

    def get(self) -> Adjustment:
        if self._found is None:
            raise InputError(f"the equations are not there: {self.state()}", "wait a moment, or adjust again")
        return self._found
