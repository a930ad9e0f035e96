"""Is an error in the tie points or in the control? The block adjusted free of its control as well."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aerotri.conventions import FilePath, InputError
from aerotri.observations import Block
from aerotri.public.adjustment import Adjustment
from aerotri.public.progress import ProgressLike, stage_report

if TYPE_CHECKING:
    from aerotri.strategies.free_stages import FreeCheck


def refuse_free_datum(block: Block) -> None:
    """A free adjustment tells errors of control only from a block that control holds.

    Raises
    ------
    InputError
    """
    datum = block.settings.adjustment.datum
    if datum != "control":
        raise InputError(
            f'with datum = "{datum}" the block is free of its control already',
            'leave the free check (--check-free) out, or set datum = "control"',
            file="block.toml",
        )


def free_check(
    source: Adjustment | Block, *, geoid: FilePath | None = None, progress: ProgressLike = None
) -> FreeCheck:
    """Adjust a block with a minimal datum, and compare it with its control.

    Parameters
    ----------
    source : a result; or a block that cannot be adjusted with its control.
    geoid, progress : as of `aerotri.adjust`.

    Returns
    -------
    FreeCheck
        Its stages, the points suspected, and a verdict in words.

    Raises
    ------
    InputError
        When the block is not held by its control.
    """
    from aerotri.coordinates.blocks import frame_of_block, transform_block
    from aerotri.pipeline import adjust
    from aerotri.strategies.free_check import check_free

    refuse_free_datum(source.block if isinstance(source, Adjustment) else source)
    with stage_report(progress) as report:
        report.stage("adjusting free", None)
        if isinstance(source, Adjustment):
            # all stages in one frame, that of the adjustment
            return check_free(source.record.local.block, adjust, source.record.local)
        local = source if source.crs == "local" else transform_block(source, frame_of_block(source, geoid))
        return check_free(local, adjust)
