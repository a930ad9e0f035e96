"""A block from files of other programs whose image points are read piece by piece: all else is held, they are not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.assembly import kinds
from aerotri.formats.assembly.assemble import rays_to_mm, refuse_outside
from aerotri.formats.assembly.bulk import Bulk
from aerotri.formats.assembly.kinds import ReadingOptions
from aerotri.formats.assembly.parts import RayList
from aerotri.formats.assembly.project import (
    Request,
    Sources,
    assembled,
    kind_of_source,
    reading_options,
    sigma_in_px,
)
from aerotri.formats.block.in_pieces import BlockInPieces, PieceOfRays, open_in_pieces
from aerotri.formats.block.writer import write_block
from aerotri.formats.convert import READERS
from aerotri.formats.foreign.colmap_pieces import open_colmap
from aerotri.formats.foreign.ign import files_of
from aerotri.formats.foreign.section_pieces import open_bingo, open_patb_im
from aerotri.formats.text.notes import left_behind
from aerotri.observations import Block, ImagePoints

IN_PIECES = "COLMAP, PAT-B (.im) and BINGO"
"""What is read in pieces, in words."""


@dataclass(frozen=True, eq=False)
class ProjectInPieces:
    """A block without its image points, and the way to them; what `dividing_pieces` divides.

    Parameters
    ----------
    block : no image points; `points` are the names of control and check points alone.
    messages : what the user should know. bulk : the image points of the source.
    more : those of further files, which are held. sigma_um, sigma_px : σ of image points; one of both.
    """

    block: Block
    messages: tuple[str, ...]
    bulk: Bulk
    more: PieceOfRays
    sigma_um: float | None
    sigma_px: float

    def pieces(self) -> Iterator[PieceOfRays]:
        """All image points, some at a time.

        Raises
        ------
        InputError
            As `read_project`.
        """
        import pyarrow as pa

        first_row = 0
        for rays in self.bulk.pieces():
            camera = self.block.images.camera[rays.image]
            xy = rays_to_mm(rays.xy, rays.unit, camera, self.block.cameras)
            refuse_outside(self.block, rays.path, rays.image, rays.points[rays.point], xy)
            measured = ImagePoints(rays.image, rays.point, xy, self._sigma(rays.image))
            yield PieceOfRays(measured, pa.array(rays.points.tolist(), pa.string()), first_row)
            first_row += len(measured)
        rays = replace(self.more.rays, sigma=self._sigma(self.more.rays.image))
        yield PieceOfRays(rays, self.more.names, first_row)

    def twice(self, rows: tuple[int, int]) -> InputError:
        """The error of a point that is there twice in a photograph, in two rows from 0."""
        for piece in self.pieces():
            row = max(rows) - piece.first_row
            if 0 <= row < len(piece.rays):
                point = piece.names[int(piece.rays.point[row])].as_py()
                image = self.block.images.names[piece.rays.image[row]]
                return InputError(
                    f"point '{point}' in photograph '{image}' is measured in another file already",
                    "give one of the two files, or remove the row from one", self.bulk.heads.path,
                )  # fmt: skip
        raise ValueError(f"there are no rows {rows}")

    def _sigma(self, image: np.ndarray) -> np.ndarray:
        if self.sigma_um is not None:
            return np.full((len(image), 2), self.sigma_um * 1e-3)
        return sigma_in_px(self.block, image, self.sigma_px)


def read_in_pieces(request: Request, room: Path) -> ProjectInPieces:
    """The block of a request, its image points not held.

    What is held is as it is read from a block folder, to the last digit.

    Parameters
    ----------
    room : a folder for what is held.

    Raises
    ------
    InputError
        As `read_project`; when the source is of a format that is not read in pieces.
    """
    kind, path = kind_of_source(request)
    if kind == "block":
        raise InputError("is a block folder", f"divide it: aerotri divide {path} --parts N", path)
    if kind != "colmap" and (kind in READERS or (path.is_dir() and not files_of(path, ".im"))):
        raise _whole_only(kind or "ign", path)
    always, found = _control_names(request, path), list[Bulk]()

    def colmap(folder: Path, pixel_um: float) -> tuple[Block, None]:
        block, bulk = open_colmap(folder, pixel_um, always)
        found.append(bulk)
        heads = bulk.heads
        sigma = np.full_like(heads.xy, pixel_um * 1e-3)
        return replace(
            block, points=heads.points, image_points=ImagePoints(heads.image, heads.point, heads.xy, sigma)
        ), None

    def rays(kind: str, file: Path, _: ReadingOptions) -> RayList:
        if kind not in ("patb-im", "bingo"):
            raise _whole_only(kind, file)
        found.append((open_patb_im if kind == "patb-im" else open_bingo)(file, always))
        return found[-1].heads

    reading = assembled(request, Sources(colmap, rays))
    if not found:
        raise _whole_only(kind or "a list of orientations", path)
    block, bulk = reading.block, found[0]
    rows = slice(len(bulk.heads.image), None)
    r = block.image_points
    import pyarrow as pa

    used, point = np.unique(r.point[rows], return_inverse=True)
    more = PieceOfRays(
        ImagePoints(r.image[rows], point.ravel(), r.xy[rows], r.sigma[rows]),
        pa.array(block.points[used].tolist(), pa.string()), 0,
    )  # fmt: skip
    sigma_px = 1.0 if request.image_sigma_px is None else request.image_sigma_px
    held = _held(block, room)
    lost = (left_behind("could not be carried over: start values of object points"),) if kind == "colmap" else ()
    return ProjectInPieces(held.block, (*reading.messages, *lost), bulk, more, request.image_sigma_um, sigma_px)


def _held(block: Block, room: Path) -> BlockInPieces:
    """The block without image points, as it is read from a folder: angles in degrees are rounded there."""
    nothing = np.zeros(0, np.int64)
    bare = ImagePoints(nothing, nothing, np.zeros((0, 2)), np.zeros((0, 2)))
    write_block(replace(block, image_points=bare), room, tables="parquet")
    read = open_in_pieces(room)
    if read is None:
        raise ValueError("a block that was put together has no decisions, constraints or datum points")
    return read


def _control_names(request: Request, path: Path) -> frozenset[str]:
    """Names of control points in the files of image points: the sample has all their rays."""
    options, prefix = reading_options(request), request.stated.control_prefix
    lists = [kinds.read_control(request.control, options)] if request.control else []
    lists += [
        kinds.read_control(f"patb-con:{file}", options) for file in (files_of(path, ".con") if path.is_dir() else [])
    ]
    return frozenset(prefix + name for points in lists for name in points.points.tolist())


def _whole_only(kind: str, path: Path) -> InputError:
    return InputError(
        f"is of the format {kind}, which is not read in pieces; {IN_PIECES} are",
        "convert it whole, then divide: aerotri convert SOURCE --out BLOCK; aerotri divide BLOCK", path,
    )  # fmt: skip
