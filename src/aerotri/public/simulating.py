"""Blocks with known truth, and photographs of them, from a flight plan."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.observations import Block
from aerotri.public.folders import refuse_existing_file, refuse_foreign_entries
from aerotri.public.progress import ProgressLike, stage_report

if TYPE_CHECKING:
    import numpy as np

    from aerotri.public.image_errors import ImageErrors
    from aerotri.public.surfaces import Surface
    from aerotri.public.table import Table
    from aerotri.public.truth import TrueBlock
    from aerotri.simulation import SimulationSpec, Truth
    from aerotri.simulation.placing import Placement
    from aerotri.simulation.rendering import RenderOptions, Scene

MOST_BLUR_PX, MOST_NOISE = 20.0, 20_000.0
"""σ of the blur, pixels, and of the noise, grey values of 65 535, at most; chosen [C]: beyond them no texture is left,
and a wide blur needs wide margins around every piece."""
MOST_CONTRAST, LEAST_DETAIL_PX, MOST_DETAIL_PX = 1.0, 0.5, 100.0
"""RMS of the texture over its mean, at most, and size of the finest texture, pixels; chosen [C]: more contrast has no
light and shade between black and white, finer texture is lost in a pixel, coarser shows nothing to match."""


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedBlock:
    """A block together with the truth behind it.

    Parameters
    ----------
    block : what was measured, in the CRS of the plan where it names one.
    truth : orientations, points and image errors as they are, in the same system.
    plan : the flight plan. seed : of the random numbers.
    """

    block: Block
    truth: Truth
    plan: SimulationSpec
    seed: int

    @property
    def summary(self) -> dict[str, Any]:
        """What the command prints as JSON: how much was measured."""
        is_check = self.block.control.is_check
        return {
            "block": self.block.name,
            "images": len(self.block.images),
            "image_points": len(self.block.image_points),
            "points": len(self.block.points),
            "control": int((~is_check).sum()),
            "check": int(is_check.sum()),
        }

    @property
    def true_images(self) -> Table:
        """Where the photographs were really taken; m and degrees."""
        return self._true.images()

    @property
    def true_points(self) -> Table:
        """Where the object points really are, in the order of the block; m."""
        return self._true.points()

    @property
    def gross_errors(self) -> Table:
        """Image points that were made wrong, and by how much; µm."""
        return self._true.gross_errors()

    def true_image_errors(
        self, camera: str | None = None, day: str = "", without_orientation: bool = False, nodes: int | None = None
    ) -> ImageErrors:
        """What the camera really does wrong, measured − ideal, on a grid over its format.

        Parameters
        ----------
        camera : name; the first where None.
        day : of a flight of several days, '1', '2' …; the first where ''.
        without_orientation, nodes : as of `Adjustment.image_errors`.

        Raises
        ------
        InputError
            For a camera or a day that the flight does not have.
        """
        return self._true.image_errors(camera, day, without_orientation, nodes)

    def true_heights(self, xy: np.ndarray) -> np.ndarray:
        """(n,) m, true heights of the ground, or of the roof over it, at places (n, 2) in the block's coordinates."""
        return self._true.heights(xy)

    def true_surface(self, cell: float, area: tuple[float, float, float, float] | None = None) -> Surface:
        """The true ground with its houses as a surface.

        Parameters
        ----------
        cell : m.
        area : m, X and Y of the lower left, then of the upper right corner; as far as object points reach where None.

        Raises
        ------
        InputError
            For a cell or an area without size, or too many cells.
        """
        return self._true.surface(cell, area)

    @property
    def _true(self) -> TrueBlock:
        from aerotri.public.truth import TrueBlock

        return TrueBlock(self.block, self.truth, self.plan, self.seed)

    def save(
        self,
        out: FilePath,
        *,
        photographs: bool = False,
        only: Sequence[str] = (),
        targets: bool = False,
        blur_px: float = 0.5,
        noise: float = 50.0,
        contrast: float = 0.25,
        detail_px: float = 2.0,
        overwrite: bool = False,
        progress: ProgressLike = None,
    ) -> Path:
        """Write the block's folder, with its truth in truth/, and photographs in photographs/.

        Parameters
        ----------
        out : folder; files of others stay. Photographs of an older block of this place are removed.
        photographs : render photographs, as the plan says: 16 bit TIFF, or JPEG with EXIF. With them come the true
            ground as a raster, truth/surface.tif, and in a CRS the control points measured in them, gcp_list.txt.
        only : names of the photographs to render; all where empty.
        targets : render bright discs at control and check points, also where the plan does not ask for them.
        blur_px : σ of the point spread, pixels.
        noise : σ of the grey values.
        contrast : RMS of the texture of the ground over its mean grey value.
        detail_px : size of the finest texture, pixels.
        overwrite : replace files that aerotri has not written, or that were changed since.
        progress : see `aerotri.adjust`.

        Returns
        -------
        Path of the folder.

        Raises
        ------
        InputError
            When the folder holds files of others, cannot be written to, or has too little room; for a photograph that
            the block does not have.
        """
        from aerotri.formats.files.work_place import held
        from aerotri.simulation.photograph_files import chosen_photographs

        if not (0.0 <= blur_px <= MOST_BLUR_PX and 0.0 <= noise <= MOST_NOISE):
            raise InputError(f"blur_px {blur_px:g} or noise {noise:g} is not possible",
                             f"give 0 to {MOST_BLUR_PX:g} px and 0 to {MOST_NOISE:g}")  # fmt: skip
        if not (0.0 <= contrast <= MOST_CONTRAST and LEAST_DETAIL_PX <= detail_px <= MOST_DETAIL_PX):
            remedy = f"give 0 to {MOST_CONTRAST:g}, and {LEAST_DETAIL_PX:g} to {MOST_DETAIL_PX:g} px"
            raise InputError(f"contrast {contrast:g} or detail_px {detail_px:g} is not possible", remedy)
        target = Path(out)
        chosen = chosen_photographs(self.block, only) if photographs else []
        with held(target), stage_report(progress) as report:
            if not photographs:
                self._write_block(target, (), overwrite)
                return target
            from aerotri.compiled import compilation_notice
            from aerotri.simulation.photograph_files import PHOTOGRAPHS, gnss_fixes, write_photographs
            from aerotri.simulation.rendering import RenderOptions

            looks = RenderOptions(
                contrast=contrast, detail_px=detail_px, blur_px=blur_px, noise=noise,
                targets=targets or self.plan.photographs.targets,
            )  # fmt: skip
            scene, place = self._scene(looks)
            self._write_block(target, chosen, overwrite, lambda folder: self._write_beside(folder, scene, place))
            report.stage(compilation_notice() or "rendering", None)
            write_photographs(
                scene, chosen, target / PHOTOGRAPHS, lambda share: report.stage("rendering", share),
                self.plan.photographs.format, gnss_fixes(self.block, place),
            )  # fmt: skip
        return target

    def _scene(self, looks: RenderOptions) -> tuple[Scene, Placement | None]:
        """The scene in the plane of the simulation, and where on Earth that is."""
        from aerotri import simulation
        from aerotri.simulation.placing import placement
        from aerotri.simulation.rendering import make_scene

        if self.plan.georeference is None:
            return make_scene(self.plan, self.seed, self.block, self.truth, looks), None
        block, truth = simulation.simulate(self.plan, self.seed)
        return make_scene(self.plan, self.seed, block, truth, looks), placement(self.plan.georeference)

    def _write_beside(self, folder: Path, scene: Scene, place: Placement | None) -> None:
        """The true ground, and the control points as they are measured in the photographs."""
        from aerotri.formats.foreign.odm import write_odm_gcp
        from aerotri.simulation.photograph_files import file_name
        from aerotri.simulation.true_surface import SURFACE, write_true_surface
        from aerotri.simulation.truth import MARKED_CONTROL, TRUTH

        points = self.truth.points if place is None else place.from_crs(self.truth.points)
        write_true_surface(folder / TRUTH / SURFACE, scene.terrain, points, scene.gsd_m, place)
        if place is not None and len(self.block.control):
            images = self.block.images
            files = np.array([file_name(name, self.plan.photographs.format) for name in images.names.tolist()])
            write_odm_gcp(replace(self.block, images=replace(images, names=files)), folder / MARKED_CONTROL)

    def _write_block(
        self, target: Path, chosen: Sequence[int], overwrite: bool, further: Callable[[Path], None] | None = None
    ) -> None:
        """The block with its truth in one step; photographs of an older one go with it."""
        from aerotri.formats.block.writer import OWN_ENTRIES
        from aerotri.simulation import write_simulated
        from aerotri.simulation.photograph_files import PHOTOGRAPHS, RECORD, file_name, rendered_before
        from aerotri.simulation.truth import MARKED_CONTROL, TRUTH

        refuse_foreign_entries(target, (*OWN_ENTRIES, TRUTH, MARKED_CONTROL), overwrite)
        older = rendered_before(target)
        for image in chosen:
            name = file_name(str(self.block.images.names[image]), self.plan.photographs.format)
            if name not in older:
                refuse_existing_file(target / PHOTOGRAPHS / name, overwrite)
        # none of them may stand beside another block
        gone = {f"{PHOTOGRAPHS}/{name}" for name in (*older, RECORD)} if older else set()
        write_simulated(target, self.block, self.truth, gone, further)

    def __repr__(self) -> str:
        block = self.block
        return (
            f"<aerotri.SimulatedBlock {block.name!r}, seed {self.seed}: {len(block.images)} photographs, "
            f"{len(block.points)} points>"
        )


def simulate(plan: FilePath | Mapping[str, Any], seed: int = 1) -> SimulatedBlock:
    """A block with known truth, from a flight plan.

    Parameters
    ----------
    plan : file simulation.toml, or its tables as nested dictionaries; `example_flight` gives a small one.
    seed : the same seed gives the same block.

    Returns
    -------
    SimulatedBlock

    Raises
    ------
    InputError
        For a plan that makes no sense.

    Examples
    --------
    >>> import aerotri
    >>> flight = aerotri.simulate(aerotri.example_flight(), seed=1)
    >>> len(flight.block.images), flight.truth.points.shape[1]
    (12, 3)
    """
    from aerotri import simulation

    spec = simulation.parse_spec(plan) if isinstance(plan, Mapping) else simulation.read_spec(plan)
    made = simulation.simulate(spec, seed)
    if spec.georeference is not None:
        from aerotri.simulation.placing import placed, placement

        made = placed(*made, placement(spec.georeference))
    return SimulatedBlock(*made, spec, seed)


def example_flight() -> dict[str, Any]:
    """The plan of a small flight, to try things on: two strips of six photographs, six control and four check points.

    Returns
    -------
    dict
        Tables as simulation.toml has them; change what you like.

    Examples
    --------
    >>> import aerotri
    >>> plan = aerotri.example_flight()
    >>> plan["flight"]["strips"] = 3
    >>> len(aerotri.simulate(plan, seed=1).block.images)
    18
    """
    return {
        "name": "example",
        "camera": {"camera": {"model": "frame", "size_px": [5472, 3648], "pixel_um": 2.4, "focal_length_mm": 8.8,
                              "flight_axis": "+y"}},
        "flight": {"gsd_m": 0.03, "strips": 2, "images_per_strip": 6, "end_lap": 0.75, "side_lap": 0.5,
                   "heading_deg": 0.0, "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [1.0, 1.0, 1.0]},
        "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 5.0, "wavelength_m": 150.0},
        "tie_points": {"per_image": 80, "sigma_um": 1.2},
        "control": {"positions": [[0.02, 0.05], [0.02, 0.95], [0.5, 0.1], [0.5, 0.9], [0.98, 0.05], [0.98, 0.95]],
                    "sigma_m": [0.01, 0.01, 0.015], "check_points": 4},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.1},
    }  # fmt: skip
