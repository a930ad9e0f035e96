"""Where all parts of a block with a coordinate system are adjusted: one local frame, that of the block in one piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.coordinates.blocks import needs_positions, places_of
from aerotri.coordinates.georeference import is_projected
from aerotri.coordinates.local_frame import LocalFrame, local_frame
from aerotri.formats.block.folder import settings_file
from aerotri.formats.block.in_pieces import read_without_rays
from aerotri.observations import Block


@dataclass(frozen=True, eq=False)
class Place:
    """A local frame, in a form that tasks can be given.

    Parameters
    ----------
    crs : of the block. origin : (3,), see `LocalFrame`. around : (k, 3) the outermost places of the block in the CRS.
    geoid : grid for heights, where PROJ does not have it; every worker sees it under this name.
    """

    crs: str
    origin: np.ndarray
    around: np.ndarray
    geoid: Path | None

    def frame(self) -> LocalFrame:
        """The frame."""
        return local_frame(self.crs, self.around, self.geoid, self.origin)


def place_of(sources: Sequence[Path], geoid: Path | None) -> Place | None:
    """The place of a block from the folders of its parts, whose image points are not read; None of a local block.

    Raises
    ------
    InputError
        When the parts are in several systems, the CRS is of no use, or a grid is missing; when the place of something
        depends on the adjustment.
    """
    # pydantic is imported by the settings model only when a block is read
    from aerotri.formats.block.settings import read_block_toml

    crs = [read_block_toml(settings_file(source)).model.crs for source in sources]
    other = next((k for k, one in enumerate(crs) if one != crs[0]), None)
    if other is not None:
        message = f"part {sources[other].name} is in '{crs[other]}', part {sources[0].name} in '{crs[0]}'"
        raise InputError(message, "give all parts the same crs", sources[other] / "block.toml")
    if crs[0] == "local":
        return None
    parts = [read_without_rays(source) for source in sources]
    for part in parts:
        refuse_partly_known(part)
    centres = np.concatenate([part.images.centre for part in parts])
    # photographs that stand in several parts count once, as in the block
    _, once = np.unique(np.concatenate([part.images.names for part in parts]), return_index=True)
    observed = [part.control.xyz for part in parts]
    observed += [part.gnss_ins.xyz for part in parts if part.gnss_ins is not None]
    around = places_of(np.concatenate(observed), centres[np.sort(once)])
    around = around[np.isfinite(around[:, :2]).all(axis=1)]
    frame = local_frame(crs[0], around, geoid)
    lon_lat = frame.georeference.horizontal.transform(around[:, 0], around[:, 1])
    outermost = [pick(values) for values in lon_lat for pick in (np.argmin, np.argmax)]
    return Place(crs[0], frame.origin, around[np.unique(outermost)], geoid)


def refuse_partly_known(part: Block) -> None:
    """Refuse coordinates whose place in the local frame depends on others, which are only known when it is adjusted.

    Raises
    ------
    InputError
    """
    if part.crs != "local" and not is_projected(part.crs):
        remedy = "divide the block by aerotri divide, which brings it to metres, or give it in a projected system"
        raise InputError(f"a part in {part.crs}, which counts in degrees", remedy)
    if part.crs != "local" and needs_positions(part):
        raise InputError(
            "control points or observed positions with empty coordinates, in a coordinate system, in a block in parts",
            "give X, Y and Z of each, or bring the block to a local system",
        )
