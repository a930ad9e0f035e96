"""What a simulated flight really is: tables, image errors and the ground, to compare results with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.public.image_errors import ImageErrors
from aerotri.public.surfaces import Surface
from aerotri.public.table import Table

if TYPE_CHECKING:
    from aerotri.observations import Block
    from aerotri.simulation import SimulationSpec, Truth

MOST_CELLS = 100_000_000
"""Cells of a true surface at most; chosen [C]: 100 million take 1.6 GB."""
ANGLES = ("omega", "phi", "kappa")


@dataclass(frozen=True, eq=False)
class TrueBlock:
    """The truth behind a simulated block, as tables have it.

    Parameters
    ----------
    block : what was measured. truth : what it really is. plan : the flight plan. seed : of the random numbers.
    """

    block: Block
    truth: Truth
    plan: SimulationSpec
    seed: int

    def images(self) -> Table:
        """As `SimulatedBlock.true_images`."""
        columns: dict[str, Any] = {"image": self.block.images.names}
        columns |= {name: self.truth.centre[:, k] for k, name in enumerate(("X0", "Y0", "Z0"))}
        columns |= {name: np.degrees(self.truth.angles[:, k]) for k, name in enumerate(ANGLES)}
        units: dict[str, str] = {**dict.fromkeys(("X0", "Y0", "Z0"), "m"), **dict.fromkeys(ANGLES, "°")}
        return Table.of("true photographs", columns, units)

    def points(self) -> Table:
        """As `SimulatedBlock.true_points`."""
        columns: dict[str, Any] = {"point": self.block.points}
        columns |= {axis: self.truth.points[:, k] for k, axis in enumerate("XYZ")}
        return Table.of("true points", columns, dict.fromkeys("XYZ", "m"))

    def gross_errors(self) -> Table:
        """As `SimulatedBlock.gross_errors`."""
        rays, wrong = self.block.image_points, self.truth.gross_errors
        micron = 1e3 * self.truth.gross_error_mm.reshape(-1, 2)
        columns = {
            "image": self.block.images.names[rays.image[wrong]], "point": self.block.points[rays.point[wrong]],
            "dx": micron[:, 0], "dy": micron[:, 1],
        }  # fmt: skip
        return Table.of("gross errors", columns, {"dx": "µm", "dy": "µm"})

    def image_errors(self, camera: str | None, day: str, without_orientation: bool, nodes: int | None) -> ImageErrors:
        """As `SimulatedBlock.true_image_errors`.

        Raises
        ------
        InputError
            For a camera or a day that the flight does not have.
        """
        from aerotri.image_errors import field_of, lens_errors
        from aerotri.simulation import true_image_errors
        from aerotri.simulation.cameras import true_camera

        known = true_image_errors(self.plan, self.seed)
        chosen = next(iter(known))[0] if camera is None else camera
        days = [own for name, own in known if name == chosen]
        if not days:
            names = ", ".join(one.name for one in self.block.cameras)
            raise InputError(f"there is no camera '{chosen}'", f"the flight has {names}")
        asked = day or days[0]
        if asked not in days:
            raise InputError(f"there is no day '{day}'", f"the flight has {', '.join(filter(None, days)) or 'no days'}")
        own = next(one for one in self.block.cameras if one.name == chosen)
        name, true = f"true, day {asked}" if asked else "true", true_camera(chosen, self.plan.camera[chosen])

        def error(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            lens = lens_errors(true.focal_length, (true.x0, true.y0), true.lens, x, y)
            return known[chosen, asked](x, y) + lens

        return ImageErrors(name, field_of(own, name, error, nodes, without_orientation))

    def heights(self, xy: np.ndarray) -> np.ndarray:
        """(n,) m, of the ground or of the roof over it, at (n, 2) in the coordinate system of the block."""
        from aerotri.simulation.placing import placement
        from aerotri.simulation.random_streams import stream
        from aerotri.simulation.terrain import make_terrain
        from aerotri.simulation.true_surface import true_heights

        place = None if self.plan.georeference is None else placement(self.plan.georeference)
        terrain = make_terrain(self.plan.terrain, self.plan.flight.centre_m, stream(self.seed, "terrain"))
        return true_heights(terrain, np.asarray(xy, dtype=float), place)

    def surface(self, cell: float, area: tuple[float, float, float, float] | None) -> Surface:
        """As `SimulatedBlock.true_surface`.

        Raises
        ------
        InputError
            For a cell or an area without size, or too many cells.
        """
        from aerotri.rasters.grids import crs_of_heights

        xy = self.truth.points[:, :2]
        left, bottom, right, top = area if area is not None else (*xy.min(axis=0), *xy.max(axis=0))
        if not (cell > 0.0 and right > left and top > bottom):
            remedy = "give a cell larger than 0, and X and Y of the lower left, then of the upper right corner"
            raise InputError(f"cells of {cell:g} m and the area {area} are no surface", remedy)
        rows, columns = (max(1, round((high - low) / cell)) for low, high in ((bottom, top), (left, right)))
        if rows * columns > MOST_CELLS:
            raise InputError(f"{rows} × {columns} cells are too many", "take a larger cell, or a smaller area")
        x, y = left + cell * (np.arange(columns) + 0.5), top - cell * (np.arange(rows) + 0.5)
        z = self.heights(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)).reshape(rows, columns)
        return Surface.of_array(z, left=float(left), top=float(top), cell=cell, crs=crs_of_heights(self.block.crs),
                                name="true surface")  # fmt: skip
