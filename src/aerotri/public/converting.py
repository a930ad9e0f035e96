"""Blocks and results in the formats of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.observations import Block
from aerotri.public.adjustment import Adjustment
from aerotri.public.blocks import PathLike, read

if TYPE_CHECKING:
    import numpy as np


def convert(
    block: Block | Adjustment | PathLike, out: PathLike, to: str = "block", points: np.ndarray | None = None
) -> tuple[str, ...]:
    """Write a block or a result, in our format or in that of another program.

    Parameters
    ----------
    block : a block, written at its start values; a result, written as adjusted; or files that `read` reads.
    out : file or folder to write.
    to : 'block', 'bal', 'colmap', … as `aerotri convert --to` has them.
    points : (N, 3) m, object points of a block, for formats that hold them.

    Returns
    -------
    tuple of str
        What the target cannot hold, in sentences.

    Raises
    ------
    InputError
        For a format that is not known, or a block that it cannot hold at all.

    Examples
    --------
    >>> import aerotri, tempfile
    >>> block = aerotri.simulate(aerotri.example_flight(), seed=1).block
    >>> with tempfile.TemporaryDirectory() as place:
    ...     said = aerotri.convert(block, f"{place}/copy")
    ...     len(aerotri.read_block(f"{place}/copy").images)
    12
    """
    from aerotri.formats.assembly.oriented import oriented_from_adjusted
    from aerotri.formats.convert import BLOCK_WRITERS, write_any, write_oriented

    if isinstance(block, Adjustment):
        if to != "block" and to not in BLOCK_WRITERS:
            return tuple(write_oriented(oriented_from_adjusted(block.adjusted), Path(out), to))
        block = block.block
    elif not isinstance(block, Block):
        found = read(block)
        block, points = found.block, found.points if points is None else points
    return tuple(write_any(block, Path(out), to, points))
