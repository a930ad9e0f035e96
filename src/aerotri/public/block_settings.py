"""A block with other settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from aerotri.conventions import FilePath
from aerotri.observations import Block
from aerotri.public.blocks import as_block

TABLES = ("gnss", "ins", "collocation", "deviations")
"""Tables of block.toml beside [adjustment] that can be changed."""


def with_settings(block: Block | FilePath, *, parameters: str | None = None, **settings: Any) -> Block:
    """The block with other settings of its adjustment.

    Parameters
    ----------
    block : a block, or the folder of one.
    parameters : additional parameters, as `aerotri.adjust` takes them.
    settings : by their names in [adjustment] of block.toml, such as `parameter_groups` or `correlation_limit`; the
        tables `gnss`, `ins`, `collocation` and `deviations` as dictionaries. None: as the block has it.

    Returns
    -------
    Block

    Raises
    ------
    InputError
        For a setting that there is not, or a value that it cannot have.

    Examples
    --------
    >>> import aerotri
    >>> block = aerotri.simulate(aerotri.example_flight(), seed=1).block
    >>> changed = with_settings(block, parameters="bluh:1-12", robust="huber", gnss={"shift": "strip"})
    >>> changed.settings.adjustment.robust, changed.settings.gnss.shift
    ('huber', 'strip')
    """
    from aerotri.formats.block.settings import checked_settings
    from aerotri.functional_model.additional_parameters import parse_parameters

    found = as_block(block)
    given = {name: value for name, value in settings.items() if value is not None}
    tables: dict[str, Mapping[str, Any]] = {name: given.pop(name) for name in TABLES if name in given}
    changed = {name: replace(getattr(found.settings, name), **checked_settings(name, values))
               for name, values in tables.items()}  # fmt: skip
    own = checked_settings("adjustment", given)
    if parameters is not None:
        own["additional_parameters"] = parse_parameters(parameters)
    changed["adjustment"] = replace(found.settings.adjustment, **own)
    return replace(found, settings=replace(found.settings, **changed))
