"""Control that is there before the flight, from a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.text.tables import Columns, read_table
from aerotri.planning.plan import Given

NONE: Given = ((), np.zeros((0, 3)), np.zeros((0, 3)))


def read_given_control(path: Path, sigma: tuple[float, float]) -> Given:
    """Names, coordinates and σ (k, 3) m of a table with the columns of control.csv; check points are left out.

    Parameters
    ----------
    sigma : m, of X and Y and of Z, where the table gives none.

    Raises
    ------
    InputError
    """
    table = read_table(
        path,
        Columns(text=("point",), numbers=("X", "Y", "Z"), optional_text=("role",), optional_numbers=("sX", "sY", "sZ")),
    )
    table.require("point", "X", "Y", "Z")
    names = table.text["point"].rows().astype(str)
    kept = np.ones(table.length, bool) if "role" not in table.text else table.text["role"].rows().astype(str) != "check"
    if len(set(names[kept].tolist())) < kept.sum():
        raise InputError("names a control point twice", "give every point once", path)
    stated = table.stack("sX", "sY", "sZ")
    stated = np.where(np.isfinite(stated), stated, [sigma[0], sigma[0], sigma[1]])
    if not (stated > 0.0).all():
        raise InputError("has a standard deviation that is not above 0", "give metres above 0", path)
    own = names[kept].tolist()
    clash = [name for name in own if name[:1] in "PGT" and name[1:].isdigit()]
    if clash:
        raise InputError(f"names a point '{clash[0]}', as the plan names its own", "give it another name", path)
    return tuple(own), table.stack("X", "Y", "Z")[kept], stated[kept]
