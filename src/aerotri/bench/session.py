"""One bench: the block and its result, what is looked at, and what is adjusted behind the page."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.bench.difference import difference_content
from aerotri.bench.equations import Equations
from aerotri.bench.job import Jobs
from aerotri.bench.layers import layer_picture, layers_beside, names_of, open_layer
from aerotri.bench.measuring import Measuring
from aerotri.bench.next_mark import NextMark, next_marks
from aerotri.bench.pictures import Pictures
from aerotri.bench.places import Places
from aerotri.bench.plan import ellipse_content, plan_content, plan_origin
from aerotri.bench.rays import MOST_ROWS, chosen_rays, point_content, ray_rows
from aerotri.bench.records import Records
from aerotri.bench.shown import row_of, shown_of
from aerotri.conventions import InputError
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.outliers import spread
from aerotri.statistics.reliability import critical_value

LARGEST_CUTOUT, MOST_NEXT = 1024, 20


class Bench:
    """What the pages ask for; every method may be called from any thread.

    Parameters
    ----------
    places : the folders. photographs : the folder of the photographs, None where there are none.
    below : rasters to be drawn below the plan, beside those of `aerotri run`.

    Raises
    ------
    InputError
        When the result or the block is damaged, or the folder has no photographs of the block.
    """

    def __init__(self, places: Places, photographs: Path | None = None, below: Sequence[Path] = ()):
        self.places = places
        self._lock = threading.RLock()
        self.generation = 0
        self._before: Equations | None = None
        self._jobs = Jobs("an adjustment is running already")
        self._next: tuple[Adjustment, list[NextMark]] | None = None
        self.show(places.result)
        self.pictures = Pictures(self.records.block, photographs)
        self.measuring = Measuring(lambda: self.shown, places, self.pictures)
        self._layers = [open_layer(path) for path in (*below, *layers_beside(places.result))]

    def show(self, result: Path | None) -> None:
        """Take up a result, or the block alone."""
        shown = shown_of(self.places.readable_block, result)
        with self._lock:
            self.shown = shown
            self.generation += 1

    @property
    def records(self) -> Records:
        """The tables of what is shown."""
        return self.shown.records

    @property
    def equations(self) -> Equations:
        """The equations of what is shown, which are set up beside the page."""
        return self.shown.equations

    def summary(self) -> dict[str, Any]:
        """What the head of the page says."""
        shown, r = self.shown, self.records
        o = r.outcome
        return {
            "name": str(r.block.name), "result": "" if shown.result is None else shown.result.name,
            "status": o.get("status", "not adjusted"), "verdict": o.get("verdict", ""),
            "reasons": o.get("reasons", []), "sigma0": o.get("sigma0"), "sigma0_um": o.get("sigma0_um"),
            "limit": spread(r.w) * critical_value(r.block.settings.adjustment.alpha), "counts": r.block.counts,
            "crs": r.block.crs, "generation": self.generation,
            "sizes": [list(camera.size_px) for camera in r.block.cameras], "camera": r.block.images.camera.tolist(),
            "is_rough": shown.rough is not None, "compared": self._before is not None,
            "pictures": sorted(self.pictures.paths()),
        }  # fmt: skip

    def state(self) -> dict[str, Any]:
        """What goes on: asked for every second."""
        return {"generation": self.generation, "equations": self.equations.state(), "job": self._jobs.state()}

    def plan(self) -> dict[str, Any]:
        """See `plan_content`."""
        return plan_content(self.records)

    def ellipses(self) -> dict[str, Any]:
        """See `ellipse_content`.

        Raises
        ------
        InputError
            When the equations are not there yet.
        """
        return ellipse_content(self.equations.get().result)

    def rays(self, first: int, image: int | None, point: int | None, text: str) -> dict[str, Any]:
        """A page of the table of rays from row `first` on."""
        shown = self.shown
        if image is not None:
            shown.image_row(image)
        if point is not None:
            shown.point_row(point)
        rows = chosen_rays(shown.records, shown.order, image, point, text)
        return {"count": len(rows), "first": first, "rows": ray_rows(shown.records, rows[first : first + MOST_ROWS])}

    def point(self, point: int) -> dict[str, Any]:
        """See `point_content`; with where it is expected in all photographs that show it, once that is known.

        Raises
        ------
        InputError
        """
        row = self.shown.point_row(point)
        return point_content(self.records, row) | {"expected": self.shown.expected(row)}

    def photograph(self, image: int) -> dict[str, Any]:
        """The rays of a photograph, and where control points are expected in it, once that is known.

        Raises
        ------
        InputError
        """
        shown = self.shown
        row = shown.image_row(image)
        rows = np.flatnonzero(shown.records.block.image_points.image == row)
        return {
            "image": row, "name": shown.image(row), "size": list(self.pictures.size(row)),
            "has_file": row in self.pictures, "rays": ray_rows(shown.records, rows),
            "expected": shown.expected_control(row),
        }  # fmt: skip

    def cutout(self, image: int, left: int, top: int, size: int) -> bytes:
        """A square of a photograph in full resolution, as JPEG.

        Raises
        ------
        InputError
        """
        if not 8 <= size <= LARGEST_CUTOUT:
            raise InputError(f"a cut-out of {size} pixels cannot be shown", f"8 to {LARGEST_CUTOUT} can")
        return self.pictures.cutout(self.shown.image_row(image), left, top, size)

    def layers(self) -> dict[str, Any]:
        """Surfaces and orthophotos to be drawn below the plan: name and bounds, from the origin of the plan."""
        origin = plan_origin(self.records)[:2].tolist() * 2
        return {"layers": [
            {"name": name, "bounds": [value - zero for value, zero in zip(one.bounds, origin, strict=True)]}
            for name, one in zip(names_of(self._layers), self._layers, strict=True)
        ]}  # fmt: skip

    def layer(self, number: int) -> bytes:
        """The picture of a layer, as JPEG.

        Raises
        ------
        InputError
        """
        return layer_picture(self._layers[row_of(number, len(self._layers), "layer")])

    def epipolar(self, image: int, point: int) -> dict[str, Any]:
        """The rays of a point in other photographs as lines in this one.

        Raises
        ------
        InputError
        """
        prediction, r = self.equations.prediction(), self.records
        row, own = self.shown.image_row(image), self.shown.point_row(point)
        if prediction is None or not np.isfinite(r.xyz[own]).all():
            return {"lines": []}
        rays = ray_rows(r, np.flatnonzero((r.block.image_points.point == own) & (r.block.image_points.image != row)))
        lines = [
            {"image": other, "line": np.round(prediction.epipolar(row, other, np.array(px), r.xyz[own]), 2).tolist()}
            for other, px in zip(rays["image"], rays["px"], strict=True)
        ]
        return {"lines": [one for one in lines if len(one["line"]) > 1]}

    def next(self) -> dict[str, Any]:
        """Which mark next: see `next_marks`; those that were set meanwhile are left out.

        Raises
        ------
        InputError
            When the equations are not there yet.
        """
        adjustment, prediction = self.equations.get(), self.equations.prediction()
        if prediction is None:
            raise InputError("the equations are not there", "wait a moment")
        if self._next is None or self._next[0] is not adjustment:
            self._next = (adjustment, next_marks(adjustment, prediction))
        names, touched = adjustment.result.block.points, self.measuring.decisions.places()
        return {"marks": [
            {"image": one.image, "point": one.point, "place": list(one.place), "is_control": one.is_control,
             "before": one.before, "after": one.after}
            for one in self._next[1] if (self.shown.image(one.image), str(names[one.point])) not in touched
        ][:MOST_NEXT]}  # fmt: skip

    def adjust(self) -> dict[str, Any]:
        """Adjust the block as it is now, behind the page.

        Raises
        ------
        InputError
            When an adjustment is running already.
        """
        with self._lock:
            self._jobs.refuse_second()
            self.places.keep_block()
            frame, result = self.equations.frame(), self.shown.result
            geoid = "" if frame is None or frame.geoid is None else str(frame.geoid)
            out = self.places.next_result()
            words = [str(self.places.block), str(out), "" if result is None else str(result), geoid]
            self._jobs.start("aerotri.bench.worker", words, out, self._take)
        return self.state()

    def stop(self) -> dict[str, Any]:
        """Stop the adjustment that is running."""
        self._jobs.stop()
        return self.state()

    def wait(self) -> None:
        """Wait until the adjustment has ended and the equations are there."""
        self._jobs.wait()
        self.equations.wait()

    def difference(self, top: int = 10) -> dict[str, Any]:
        """What the last adjustment changed; see `difference_content`.

        Raises
        ------
        InputError
            When nothing was adjusted here, or the equations are not there yet.
        """
        if self._before is None:
            raise InputError("nothing was adjusted here yet", "press Adjust again")
        return difference_content(self._before.get().result, self.equations.get().result, top)

    def _take(self, result: Path) -> None:
        """Show a new result; the one before is what it is compared with."""
        before = self.equations if self.shown.result is not None else None
        with self._lock:
            self._before = before
            self.show(result)
