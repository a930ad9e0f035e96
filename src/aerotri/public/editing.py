"""Decisions of an operator about a block: measurements taken out, control made check points, and back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import InputError
from aerotri.public.argument_types import with_checked_types

if TYPE_CHECKING:
    from aerotri.observations import Block
    from aerotri.observations.block import Edits

EVERYWHERE = -1
"""Photograph of a decision about a whole point."""


@with_checked_types
def edit(
    block: Block,
    *,
    off: Iterable[str | tuple[str, str]] = (),
    check: Iterable[str] = (),
    control: Iterable[str] = (),
    reason: str = "",
) -> Block:
    """A block with decisions about its measurements; the measurements themselves stay as they are.

    The decisions are those of edits.csv, and are written there when the block is saved.

    Parameters
    ----------
    block : as `aerotri.read_block` gives it.
    off : to leave out: a ray as (point, photograph); by the name of a control or check point alone its coordinates (its
        rays stay), by that of a tie point all its rays.
    check : control points to be compared only.
    control : check points to be used as control.
    reason : in words, kept with the decisions.

    Returns
    -------
    Block

    Raises
    ------
    InputError
        For a name or a ray that the block does not have, or a role given to what is no control or check point.

    Examples
    --------
    >>> import aerotri
    >>> block = aerotri.simulate(aerotri.example_flight(), seed=1).block
    >>> mended = aerotri.edit(block, off=[("C01", "1_001")], check=["C05"], reason="target was moved")
    >>> len(mended.edits)
    2
    """
    rows = [_row(block, one, "off") for one in off]
    rows += [_row(block, name, "check") for name in check]
    rows += [_row(block, name, "control") for name in control]
    return replace(block, edits=_with_rows(block.edits, rows, reason))


def _row(block: Block, stated: str | tuple[str, str], action: str) -> tuple[int, int, str]:
    """Photograph, point and action by index."""
    point_name, image_name = (stated, "") if isinstance(stated, str) else stated
    point = _index(block.points, point_name, "point")
    if not image_name:
        if action != "off" and point not in block.control.point:
            raise InputError(f"'{point_name}' is not a control or check point", "name a point of control.csv")
        return EVERYWHERE, point, action
    image, rays = _index(block.images.names, image_name, "photograph"), block.image_points
    if not np.any((rays.image == image) & (rays.point == point)):
        raise InputError(f"'{point_name}' is not measured in '{image_name}'", "write both names as in image_points")
    return image, point, action


def _index(names: np.ndarray, name: str, what: str) -> int:
    found = np.flatnonzero(names == name)
    if not len(found):
        raise InputError(
            f"there is no {what} '{name}'",
            f"write the name as in {'images.csv' if what == 'photograph' else 'image_points or control'}",
        )
    return int(found[0])


def _with_rows(before: Edits | None, rows: list[tuple[int, int, str]], reason: str) -> Edits | None:
    """The decisions before and those that are new, each once; a new role of a point replaces its old one."""
    from aerotri.observations.block import Edits

    if not rows:
        return before
    new = {(image, point): (action, reason) for image, point, action in rows}
    old = [] if before is None else list(
        zip(before.image.tolist(), before.point.tolist(), before.action.tolist(), before.reason.tolist(), strict=True)
    )  # fmt: skip
    both = {(image, point): (action, why) for image, point, action, why in old} | new
    return Edits(
        image=np.array([image for image, _ in both], dtype=np.int64),
        point=np.array([point for _, point in both], dtype=np.int64),
        action=np.array([action for action, _ in both.values()], dtype=str),
        reason=np.array([why for _, why in both.values()], dtype=str),
    )
