"""The surfaces of `aerotri volume`: what each was measured with, and which adjustment the base comes from."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.commands.console import Console
from aerotri.commands.results import reopened
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from aerotri.commands.volume import VolumeInput
    from aerotri.results.adjustment import Adjustment
    from aerotri.volume.bases import Base, Surface
    from aerotri.volume.boundary import Boundary
    from aerotri.volume.parts import Part, SigmaOptions

TERRAIN = "dtm.json"
"""Beside a raster of `aerotri dtm`; says which adjustment it was measured with."""


def base_calibration(
    given: VolumeInput, calibration: Adjustment, console: Console
) -> tuple[Adjustment | None, tuple[str, ...]]:
    """The adjustment that the base's surface comes from, None where nobody says so, and sentences about it.

    That is the one stated; else that of the surface where the base is the same file, or where `aerotri dtm` wrote
    beside the base that it comes from the same adjustment.
    """
    if given.base_adjustment is not None:
        if given.adjustment is not None and given.base_adjustment.resolve() == given.adjustment.resolve():
            return calibration, ()
        return reopened(given.base_adjustment, console), ()
    base = Path(given.base)
    if base.resolve() == given.dtm.resolve():
        return calibration, ()
    if given.base_pickets is not None:
        return calibration, (f"{base.name} is taken to come from the adjustment of the surface, as no other is given",)
    from aerotri.volume.shared import adjustment_key

    stated = _stated_adjustment(base)
    if stated == adjustment_key(calibration):
        return calibration, (f"{base.name} was measured with the same adjustment, {TERRAIN} beside it says",)
    if stated:
        return None, (f"{base.name} was measured with another adjustment: --base-adjustment names it",)
    return None, ()


def _stated_adjustment(raster: Path) -> str:
    """The key that `aerotri dtm` wrote beside a raster, '' where there is none."""
    try:
        content = json.loads((raster.parent / TERRAIN).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return ""
    return str(content.get("adjustment", "")) if isinstance(content, dict) else ""


def surface_part(
    calibration: Adjustment, surface: Surface, pickets: Path | None, boundary: Boundary, base: Base | None,
    options: SigmaOptions,
) -> Part:  # fmt: skip
    """The share of a surface: of its pickets where they are given, else every cell is taken for one."""
    from aerotri.volume.parts import part_of_cells

    if pickets is None:
        return part_of_cells(calibration, surface, boundary, base, options)
    return _part_of_file(calibration, pickets, boundary, base, options)


def _part_of_file(
    calibration: Adjustment, path: Path, boundary: Boundary, base: Base | None, options: SigmaOptions
) -> Part:
    """The share of pickets.parquet as `aerotri dtm` writes it: X, Y, Z, photographs, status, sZ_matching."""
    import pyarrow as pa

    from aerotri.formats.text.parquet import load_parquet
    from aerotri.terrain.tin import order_in_plan
    from aerotri.volume.functionals import triangulated
    from aerotri.volume.parts import matching_sigma_mm, part_of_pickets
    from aerotri.volume.pickets import pickets_of_names, with_height_sigmas

    table = load_parquet(path)
    for name in ("X", "Y", "Z", "photographs"):
        if name not in table.column_names:
            raise InputError(f"has no column '{name}'", "give pickets.parquet of `aerotri dtm`", path)
    xyz = np.column_stack([table.column(axis).cast(pa.float64()).to_numpy() for axis in "XYZ"])
    names = table.column("photographs").to_pylist()
    used = np.isfinite(xyz).all(axis=1) & (np.array([len(own or ()) for own in names]) >= 2)
    if "status" in table.column_names:
        used &= np.array(table.column("status").to_pylist(), dtype=str) == "accepted"
    if used.sum() < 3:
        raise InputError("has hardly a picket that was accepted", "measure again", path)
    rows = np.flatnonzero(used)
    # what is drawn of them at random must not hang on the order of the file
    rows = rows[order_in_plan(xyz[rows])]
    pickets = pickets_of_names(
        calibration.result.block, xyz[rows], [[str(n) for n in names[k]] for k in rows],
        matching_sigma_mm(calibration, options),
    )  # fmt: skip
    if options.matching_sigma_um is None and "sZ_matching" in table.column_names:
        stated = table.column("sZ_matching").cast(pa.float64()).to_numpy()[rows]
        pickets = with_height_sigmas(calibration, pickets, stated)
    return part_of_pickets(calibration, pickets, triangulated(pickets.xyz), boundary, base, options)
